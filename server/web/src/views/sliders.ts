/** The controls of the light. */

import type { Parameters } from "../api";
import { byId } from "../dom";
import { azimuthWords, factor } from "../pure/words";

type Slider = "sun_azimuth" | "sun_elevation" | "turbidity" | "exposure";

const WORDS: Record<Slider, (parameters: Parameters) => string> = {
  sun_azimuth: ({ sun_azimuth }) => azimuthWords(sun_azimuth),
  sun_elevation: ({ sun_elevation }) => `${sun_elevation.toFixed(1)}°`,
  turbidity: ({ turbidity }) => turbidity.toFixed(1),
  exposure: ({ exposure }) => factor(exposure),
};
const NAMES = Object.keys(WORDS) as Slider[];

/** Exposure is set in stops, as powers of two of the estimate's. */
export class Sliders {
  private readonly sun = byId<HTMLInputElement>("sun");
  private neutral = 1;

  constructor(private readonly changed: (part: Partial<Parameters>, kind: string) => void) {
    for (const name of NAMES) this.input(name).addEventListener("input", () => this.moved(name));
    this.sun.addEventListener("change", () => this.changed({ sun: this.sun.checked }, "sun"));
  }

  /** Puts every control where `parameters` are; `estimate` is what the exposure counts from. */
  show(parameters: Parameters, estimate: Parameters): void {
    this.neutral = estimate.exposure;
    this.sun.checked = parameters.sun;
    for (const name of NAMES) {
      const input = this.input(name);
      input.value = String(this.position(name, parameters));
      const words = WORDS[name](parameters);
      input.setAttribute("aria-valuetext", words);
      this.output(name).value = words;
    }
  }

  private position(name: Slider, parameters: Parameters): number {
    return name === "exposure" ? Math.log2(parameters.exposure / this.neutral) : parameters[name];
  }

  private moved(name: Slider): void {
    const at = this.input(name).valueAsNumber;
    this.changed({ [name]: name === "exposure" ? this.neutral * 2 ** at : at }, name);
  }

  private input(name: Slider): HTMLInputElement {
    return byId<HTMLInputElement>(name);
  }

  private output(name: Slider): HTMLOutputElement {
    return this.input(name).parentElement?.querySelector("output") as HTMLOutputElement;
  }
}
