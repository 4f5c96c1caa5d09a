/** How far an answer can be trusted, in one word, and the suns that it lists, as chips to choose from. */

import { byId, createElement } from "../dom";
import type { Angles } from "../geometry/angles";
import { formatLateral, formatPercent, trustText } from "../text/format";
import type { Candidate, Estimate, LightParameters } from "../types";

export class Candidates {
  private readonly list = byId("suns");
  private suns: Candidate[] = [];

  constructor(private readonly onPick: (sun: Angles) => void) {}

  /** Shows those of an answer; a sure one has no chips. */
  show(estimate: Estimate): void {
    const trust = byId("trust");
    trust.textContent = trustText(estimate);
    trust.className = `trust ${estimate.trust?.replace(" ", "-") ?? ""}`;
    trust.hidden = !trust.textContent;
    this.suns = estimate.trust === "sure" ? [] : (estimate.sun.candidates ?? []);
    this.list.hidden = this.suns.length < 2;
    this.list.replaceChildren(...this.suns.map((sun) => createElement("li", {}, this.chip(sun))));
  }

  /** Marks the one that shines now. */
  mark({ sun_azimuth, sun_elevation, sun }: LightParameters): void {
    this.list.querySelectorAll("button").forEach((button, i) => {
      const { azimuth, elevation } = this.suns[i] as Candidate;
      button.setAttribute("aria-pressed", String(sun && azimuth === sun_azimuth && elevation === sun_elevation));
    });
  }

  private chip(sun: Candidate): HTMLButtonElement {
    const where = `${formatLateral(sun.azimuth)}, ${sun.elevation.toFixed(0)}° high`;
    const share = createElement("small", { textContent: formatPercent(sun.probability) });
    const button = createElement("button", { type: "button" }, `${where} `, share);
    button.addEventListener("click", () => this.onPick(sun));
    return button;
  }
}
