/** The light of other hours and days at the photo's place, on a slider. */

import { type DayHour, debounceLatest, fetchDay } from "../api";
import { byId } from "../dom";
import type { Angles } from "../geometry/angles";
import type { PhotoView } from "../state";

const HELP = "Choose a day. It needs the photo's place, and its heading or time.";

export class DayView {
  private readonly date = byId<HTMLInputElement>("day-date");
  private readonly slider = byId<HTMLInputElement>("day-hour");
  private readonly note = byId("day-note");
  private hours: DayHour[] = [];
  private view: PhotoView | undefined;

  constructor(private readonly onSun: (sun: Angles) => void) {
    const load = debounceLatest<string>(
      (date, signal) => this.load(date, signal),
      300,
      (error) => {
        this.note.textContent = error instanceof Error ? error.message : String(error);
      },
    );
    this.date.addEventListener("input", () => {
      this.clear("");
      if (this.date.value) load(this.date.value);
    });
    this.slider.addEventListener("input", () => {
      const hour = this.hours[this.slider.valueAsNumber];
      if (!hour) return;
      this.name(hour);
      this.onSun(hour.lighting.sun);
    });
  }

  /** Another photo, or another answer about it. */
  show(view: PhotoView, alone: boolean): void {
    if (view === this.view) return;
    this.view = view;
    this.date.value = "";
    this.date.disabled = !alone;
    this.clear(HELP);
  }

  private clear(note: string): void {
    this.hours = [];
    byId("day-hours").hidden = true;
    this.note.textContent = note;
  }

  private async load(date: string, signal: AbortSignal): Promise<void> {
    const { view } = this;
    if (!view) return;
    const { hours, warnings } = await fetchDay(view.photo.file, view.userInput, date, signal);
    if (signal.aborted || view !== this.view) return;
    this.hours = hours;
    this.slider.max = String(hours.length - 1);
    this.slider.value = String(Math.floor(hours.length / 2));
    byId("day-hours").hidden = false;
    this.name(hours[this.slider.valueAsNumber] as DayHour);
    this.note.textContent = warnings.join(" ");
  }

  private name({ time }: DayHour): void {
    const clock = time.slice(11, 16); // of the place
    byId("day-clock").textContent = clock;
    this.slider.setAttribute("aria-valuetext", clock);
  }
}
