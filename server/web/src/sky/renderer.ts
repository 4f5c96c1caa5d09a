/** The page's side of the worker: one question at a time, and of those that wait only the newest. */

import type { Factors } from "../picture/factors";
import type { Pixels } from "../picture/pixels";
import type { Camera } from "../pure/camera";
import type { Question } from "./light";
import type { Answer, Message } from "./worker";

const NOT_LOADED = "What renders the sky could not be loaded, so the light cannot be shown. Load the page again.";

export class SkyRenderer {
  private readonly worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  private asked = 0;
  private busy = false;
  private lost = false; // whether the worker never began
  private answered = true; // whether the newest question that came back has an answer
  private newest: Question | undefined;
  private waiting: Question | undefined;
  private idle: (() => void)[] = [];

  constructor(
    private readonly shown: (answer: Answer) => void,
    private readonly failed: (error: unknown) => void,
  ) {
    this.worker.addEventListener("message", ({ data }: MessageEvent<Answer | { id: number; error: string }>) => {
      this.busy = false;
      this.answered = !("error" in data);
      const next = this.waiting;
      this.waiting = undefined;
      if (next) this.ask(next);
      if ("error" in data) this.failed(new Error(data.error));
      else this.shown(data);
      this.release();
    });
    this.worker.addEventListener("error", ({ message }) => {
      this.busy = false;
      this.answered = false;
      this.lost ||= !message; // a worker that runs says what went wrong
      this.failed(new Error(message || NOT_LOADED));
      this.release();
    });
  }

  /** Tells those who wait that nothing is being answered any more. */
  private release(): void {
    if (!this.busy) for (const tell of this.idle.splice(0)) tell();
  }

  /** What stands around the camera from now on. */
  setPhoto(photo: Pixels, camera: Camera, factors: Factors | undefined): void {
    this.post({ photo, camera, factors });
  }

  ask(question: Question): void {
    this.newest = question;
    if (this.lost) {
      this.failed(new Error(NOT_LOADED));
      return;
    }
    if (this.busy) {
      this.waiting = question;
      return;
    }
    this.busy = true;
    this.post({ question, id: ++this.asked });
  }

  /** Waits until the newest question is answered, and asks it once more if that failed; whether there is an answer. */
  async settled(): Promise<boolean> {
    if (!this.busy && !this.answered && this.newest) this.ask(this.newest);
    if (this.busy) await new Promise<void>((resolve) => this.idle.push(resolve));
    return this.answered;
  }

  private post(message: Message): void {
    this.worker.postMessage(message);
  }
}
