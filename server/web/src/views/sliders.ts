/** The controls of the light. */

import type { LightParameters } from "../api";
import { byId } from "../dom";
import { formatAzimuth, formatFactor } from "../text/format";

type Slider = "sun_azimuth" | "sun_elevation" | "turbidity" | "exposure";

const SLIDER_TEXTS: Record<Slider, (parameters: LightParameters) => string> = {
  sun_azimuth: ({ sun_azimuth }) => formatAzimuth(sun_azimuth),
  sun_elevation: ({ sun_elevation }) => `${sun_elevation.toFixed(1)}°`,
  turbidity: ({ turbidity }) => turbidity.toFixed(1),
  exposure: ({ exposure }) => formatFactor(exposure),
};
const NAMES = Object.keys(SLIDER_TEXTS) as Slider[];

/** Exposure is set in stops, as powers of two of the estimate's. */
export class Sliders {
  private readonly sun = byId<HTMLInputElement>("sun");
  private neutral = 1;

  constructor(private readonly onChange: (part: Partial<LightParameters>, kind: string) => void) {
    for (const name of NAMES) this.input(name).addEventListener("input", () => this.onInput(name));
    this.sun.addEventListener("change", () => this.onChange({ sun: this.sun.checked }, "sun"));
  }

  /** Puts every control where `parameters` are; `estimate` is what the exposure counts from. */
  show(parameters: LightParameters, estimate: LightParameters): void {
    this.neutral = estimate.exposure;
    this.sun.checked = parameters.sun;
    for (const name of NAMES) {
      const input = this.input(name);
      input.value = String(this.position(name, parameters));
      const text = SLIDER_TEXTS[name](parameters);
      input.setAttribute("aria-valuetext", text);
      this.output(name).value = text;
    }
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
