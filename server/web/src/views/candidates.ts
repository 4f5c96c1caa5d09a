/** How far an answer can be trusted, in one word, and the suns that it lists, as chips to choose from, also on the photo. */

import { byId, createElement } from "../dom";
import { type Angles, direction } from "../geometry/angles";
import { type Camera, type Point, type Size, sunMark } from "../geometry/camera";
import { formatLateral, formatPercent, trustText } from "../text/format";
import type { Candidate, Estimate, LightParameters } from "../types";

const CHIP = 44; // CSS pixels

/** The suns of an answer among which one chooses: none of a sure one. */
export const candidatesOf = ({ trust, sun }: Estimate): Candidate[] => {
  const suns = trust === "sure" ? [] : (sun.candidates ?? []);
  return suns.length < 2 ? [] : suns;
};

/** Whether a light's sun is this one. */
export const isCandidate = (sun: Candidate, light: LightParameters): boolean =>
  light.sun && sun.azimuth === light.sun_azimuth && sun.elevation === light.sun_elevation;

export class Candidates {
  private readonly list = byId("suns");
  private readonly chips = byId("sun-chips"); // for fingers and mice; keys have the list
  private suns: Candidate[] = [];
  private camera: Camera | undefined;
  private size: Size = { width: 0, height: 0 }; // of the photo, CSS pixels

  constructor(private readonly onPick: (sun: Angles) => void) {
    new ResizeObserver(() => {
      this.size = this.chips.getBoundingClientRect();
      this.place();
    }).observe(this.chips);
  }

  /** Shows those of an answer. */
  show(estimate: Estimate): void {
    const trust = byId("trust");
    trust.textContent = trustText(estimate);
    trust.className = `trust ${estimate.trust?.replace(" ", "-") ?? ""}`;
    trust.hidden = !trust.textContent;
    this.suns = candidatesOf(estimate);
    this.list.hidden = this.suns.length === 0;
    this.list.replaceChildren(...this.suns.map((sun, i) => createElement("li", {}, this.namedChip(sun, i))));
    this.chips.replaceChildren(...this.suns.map((sun, i) => this.button(sun, { tabIndex: -1 }, String(i + 1))));
  }

  /** Marks the one that shines now, in the picture of a camera. */
  mark(light: LightParameters, camera: Camera): void {
    this.camera = camera;
    this.suns.forEach((sun, i) => {
      const shines = isCandidate(sun, light);
      this.list.querySelectorAll("button")[i]?.setAttribute("aria-pressed", String(shines));
      (this.chips.children[i] as HTMLElement).hidden = shines; // its mark is there
    });
    this.place();
  }

  /** Puts each chip where its sun is in the photo, or at the edge towards it, below those that are there. */
  private place(): void {
    if (!this.camera || this.size.width < 1) return;
    const taken: Point[] = [];
    for (const [i, chip] of [...this.chips.children].entries()) {
      if ((chip as HTMLElement).hidden) continue;
      const point = freePoint(this.suns[i] as Candidate, this.camera, this.size, taken);
      taken.push(point);
      Object.assign((chip as HTMLElement).style, { left: `${point[0]}px`, top: `${point[1]}px` });
    }
  }

  private namedChip(sun: Candidate, i: number): HTMLButtonElement {
    const where = `${formatLateral(sun.azimuth)}, ${sun.elevation.toFixed(0)}° high`;
    const share = createElement("small", { textContent: formatPercent(sun.probability) });
    return this.button(sun, {}, createElement("b", { textContent: String(i + 1) }), ` ${where} `, share);
  }

  private button(
    sun: Candidate,
    properties: Partial<HTMLButtonElement>,
    ...text: (Node | string)[]
  ): HTMLButtonElement {
    const button = createElement("button", { type: "button", ...properties }, ...text);
    button.addEventListener("click", () => this.onPick(sun));
    return button;
  }
}

function freePoint({ azimuth, elevation }: Candidate, camera: Camera, size: Size, taken: readonly Point[]): Point {
  const { point } = sunMark(direction(azimuth, elevation), camera, size, CHIP / 2);
  const row = taken.filter(([x]) => Math.abs(x - point[0]) < CHIP).map(([, y]) => y);
  let y = point[1];
  while (row.some((other) => Math.abs(other - y) < CHIP)) y += CHIP;
  return [point[0], Math.min(y, size.height - CHIP / 2)];
}
