// Drives the page through what can go otherwise: node details.mjs PAGE_URL CHROMIUM FILES_AS_JSON. Prints what it saw.
import { visitAgain } from "./again.mjs";
import { visitFormats } from "./formats.mjs";
import { visitHeld } from "./held.mjs";
import { visitLost } from "./lost.mjs";
import { visitStage } from "./stage.mjs";
import { visitSteps } from "./steps.mjs";
import { visitTouch } from "./touch.mjs";
import { visitTurned } from "./turned.mjs";
import { report } from "./visit.mjs";

await report([visitFormats, visitHeld, visitAgain, visitLost, visitSteps, visitStage, visitTurned, visitTouch]);
