/** The photo's metadata, what of them was used, the form that corrects them, and the estimate's numbers. */

import { type Lighting, modelInfo } from "../api";
import { byId, createElement } from "../dom";
import type { PhotoView, Session } from "../state";
import type { PhotoMetadata } from "../text/exif";
import { estimateRows, explainAccuracy, type NamedValue } from "../text/format";
import {
  describeBelievedTime,
  describeCameraTilt,
  describeMetadata,
  fillForm,
  formatEvidence,
  NO_USER_INPUT,
  readForm,
  type UserInput,
  type UserInputField,
  unreadSources,
} from "../text/metadata";

const FIELDS: UserInputField[] = ["time", "utc_offset", "lat", "lon", "heading", "fov", "headings"];

export class MetadataView {
  private readonly form = byId<HTMLFormElement>("user-input");
  private metadata: PhotoMetadata = {};

  constructor(onSubmit: (userInput: UserInput) => void) {
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      onSubmit(readForm(this.read(), this.metadata));
    });
    byId("forget").addEventListener("click", () => onSubmit(NO_USER_INPUT));
  }

  show({ views, userInput }: Session, { photo, estimate: answer }: PhotoView): void {
    this.metadata = photo.metadata;
    const used = unreadSources(
      answer.evidence,
      userInput,
      views.map((view) => view.photo.metadata),
    );
    byId("metadata").replaceChildren(
      ...[
        ...describeMetadata(photo.metadata, used),
        ...describeBelievedTime(answer),
        describeCameraTilt(answer, userInput),
      ].map(({ name, value }) =>
        createElement(
          "div",
          {},
          createElement("dt", { textContent: name }),
          createElement("dd", { textContent: value }),
        ),
      ),
    );
    byId("evidence").textContent = formatEvidence(answer.evidence);
    byId("warnings").replaceChildren(...answer.warnings.map((textContent) => createElement("li", { textContent })));
    byId("warnings").hidden = answer.warnings.length === 0;
    const several = views.length > 1;
    byId("field-headings").hidden = !several;
    byId("field-heading").hidden = several;
    this.fill(fillForm(photo.metadata, userInput), answer.camera.vertical_fov);
    byId<HTMLButtonElement>("forget").disabled = JSON.stringify(userInput) === JSON.stringify(NO_USER_INPUT);
  }

  private fill(userInput: UserInput, fov: number): void {
    for (const name of FIELDS) this.input(name).value = userInput[name];
    this.input("fov").placeholder = `${fov.toFixed(1)} (estimated)`;
    byId<HTMLInputElement>("input-exif").checked = userInput.exif;
  }

  private read(): UserInput {
    const texts = Object.fromEntries(FIELDS.map((name) => [name, this.input(name).value.trim()]));
    return { ...NO_USER_INPUT, ...texts, exif: byId<HTMLInputElement>("input-exif").checked };
  }

  private input(name: UserInputField): HTMLInputElement {
    return byId<HTMLInputElement>(`input-${name}`);
  }
}

/** The numbers at once, their median errors as soon as the service has stated them. */
export async function showNumbers(lighting: Lighting): Promise<void> {
  fillRows(estimateRows(lighting));
  const accuracy = (await modelInfo())?.accuracy ?? {};
  const medianErrors = accuracy.phone ?? Object.values(accuracy)[0] ?? {};
  byId("numbers-note").textContent = explainAccuracy(lighting, medianErrors);
  fillRows(estimateRows(lighting, medianErrors));
}

/** A row of the table. */
function createRow(name: string, value: string, note: string): DocumentFragment {
  const row = document.createDocumentFragment();
  row.append(
    createElement("dt", { textContent: name }),
    createElement("dd", {}, value, createElement("small", { textContent: note })),
  );
  return row;
}

function fillRows(rows: NamedValue[]): void {
  const hasErrors = rows.some(({ medianError }) => medianError);
  byId("numbers").replaceChildren(
    ...(hasErrors ? [createElement("div", { className: "head" }, createRow("", "this photo", "usual error"))] : []),
    ...rows.map(({ name, value, note, medianError }) =>
      createElement("div", {}, createRow(name, value, medianError ?? note ?? "")),
    ),
  );
}
