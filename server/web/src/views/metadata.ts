/** The photo's metadata, what of them was used, the form that corrects them, and the estimate's numbers. */

import { type Lighting, modelInfo, type PhotoMetadata } from "../api";
import { byId, createElement } from "../dom";
import { cameraHeight } from "../geometry/placement";
import type { PhotoView, Session } from "../state";
import { estimateRows, explainAccuracy, type NamedValue } from "../text/format";
import {
  DRAWN_FIELDS,
  describeBelievedTime,
  describeBorrowed,
  describeCameraTilt,
  describeMetadata,
  fillForm,
  formatEvidence,
  NO_USER_INPUT,
  readForm,
  type UserInput,
  type UserInputField,
} from "../text/metadata";
import { markLocation } from "./location";

const FIELDS: UserInputField[] = [
  "time",
  "utc_offset",
  "latitude",
  "longitude",
  "heading",
  "vertical_fov",
  "headings",
  "camera_height",
];

export class MetadataView {
  private readonly form = byId<HTMLFormElement>("user-input");
  private metadata: PhotoMetadata = {};
  private drawn: Partial<UserInput> = {};

  constructor(onSubmit: (userInput: UserInput) => void) {
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      onSubmit(readForm(this.read(), this.metadata));
    });
    byId("forget").addEventListener("click", () => onSubmit(NO_USER_INPUT));
  }

  show({ views }: Session, { estimate: answer, userInput }: PhotoView): void {
    this.metadata = answer.photo_metadata ?? {};
    this.drawn = Object.fromEntries(DRAWN_FIELDS.map((field) => [field, userInput[field]]));
    const others = views.map(({ estimate }) => estimate.photo_metadata ?? {});
    const rows = [
      ...describeMetadata(this.metadata),
      ...describeBorrowed(answer.evidence, userInput, this.metadata, others),
      ...describeBelievedTime(answer),
      ...describeCameraTilt(answer),
    ];
    byId("metadata").replaceChildren(
      ...rows.map(({ name, value }) =>
        createElement(
          "div",
          {},
          createElement("dt", { textContent: name }),
          createElement("dd", { textContent: value }),
        ),
      ),
    );
    byId("metadata").hidden = rows.length === 0;
    byId("evidence").textContent = formatEvidence(answer.evidence);
    byId("warnings").replaceChildren(...answer.warnings.map((textContent) => createElement("li", { textContent })));
    byId("warnings").hidden = answer.warnings.length === 0;
    const several = views.length > 1;
    byId("field-headings").hidden = !several;
    byId("field-heading").hidden = several;
    this.fill(fillForm(this.metadata, userInput), answer.camera);
    byId<HTMLButtonElement>("forget").disabled = JSON.stringify(userInput) === JSON.stringify(NO_USER_INPUT);
  }

  private fill(userInput: UserInput, camera: Lighting["camera"]): void {
    for (const name of FIELDS) this.input(name).value = userInput[name];
    byId<HTMLInputElement>("input-city").value = "";
    markLocation();
    this.input("vertical_fov").placeholder = `${camera.vertical_fov.toFixed(1)} (estimated)`;
    this.input("camera_height").placeholder = `${cameraHeight(camera)} (assumed)`;
    byId<HTMLInputElement>("input-metadata").checked = userInput.metadata;
  }

  private read(): UserInput {
    const texts = Object.fromEntries(FIELDS.map((name) => [name, this.input(name).value.trim()]));
    return { ...NO_USER_INPUT, ...texts, ...this.drawn, metadata: byId<HTMLInputElement>("input-metadata").checked };
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
