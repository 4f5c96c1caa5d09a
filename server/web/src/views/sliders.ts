/** The controls of the light. */

import type { Irradiances, LightParameters } from "../api";
import { byId, createElement } from "../dom";
import {
  describeColor,
  describeExposure,
  describeHaze,
  describeHeight,
  describeShadows,
  formatAzimuth,
  type Wording,
} from "../text/format";

type Slider = "sun_azimuth" | "sun_elevation" | "warmth" | "softness" | "turbidity" | "exposure";

/** What the words of a slider follow from. */
interface Shown {
  parameters: LightParameters;
  estimate: LightParameters; // what the exposure counts from
  irradiances: Irradiances;
}

const SLIDER_WORDS: Record<Slider, (shown: Shown) => Wording> = {
  sun_azimuth: ({ parameters }) => ({ text: formatAzimuth(parameters.sun_azimuth), hint: "" }),
  sun_elevation: ({ parameters }) => describeHeight(parameters.sun_elevation),
  warmth: ({ irradiances }) => describeColor(irradiances),
  softness: ({ irradiances, parameters }) => describeShadows(irradiances, parameters),
  turbidity: ({ parameters }) => describeHaze(parameters.turbidity),
  exposure: ({ parameters, estimate }) => describeExposure(parameters.exposure, estimate.exposure),
};
const NAMES = Object.keys(SLIDER_WORDS) as Slider[];

/** Exposure is set in stops, as powers of two of the estimate's. */
export class Sliders {
  private readonly sun = byId<HTMLInputElement>("sun");
  private neutral = 1;

  constructor(private readonly onChange: (part: Partial<LightParameters>, kind: string) => void) {
    for (const name of NAMES) this.input(name).addEventListener("input", () => this.onInput(name));
    this.sun.addEventListener("change", () => this.onChange({ sun: this.sun.checked }, "sun"));
  }

  /** Puts every control where the parameters are, and the words beside it. */
  show(shown: Shown): void {
    const { parameters, estimate } = shown;
    this.neutral = estimate.exposure;
    this.sun.checked = parameters.sun;
    for (const name of NAMES) {
      const input = this.input(name);
      input.value = String(this.position(name, parameters));
      const { text, hint } = SLIDER_WORDS[name](shown);
      input.setAttribute("aria-valuetext", hint ? `${text}, ${hint}` : text);
      this.output(name).replaceChildren(text, ...(hint ? [" ", createElement("small", { textContent: hint })] : []));
    }
    this.input("softness").disabled = !parameters.sun;
    this.input("warmth").disabled = !parameters.sun;
  }

  private position(name: Slider, parameters: LightParameters): number {
    return name === "exposure" ? Math.log2(parameters.exposure / this.neutral) : parameters[name];
  }

  private onInput(name: Slider): void {
    const at = this.input(name).valueAsNumber;
    this.onChange({ [name]: name === "exposure" ? this.neutral * 2 ** at : at }, name);
  }

  private input(name: Slider): HTMLInputElement {
    return byId<HTMLInputElement>(name);
  }

  private output(name: Slider): HTMLOutputElement {
    return this.input(name).parentElement?.querySelector("output") as HTMLOutputElement;
  }
}
