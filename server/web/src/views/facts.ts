/** What the photo says, what of it was used, and the form in which it is given or corrected. */

import { byId, make } from "../dom";
import { evidenceWords, formValues, givenBy, held, said, usedUnseen } from "../pure/facts";
import { type Given, type GivenName, NOTHING } from "../pure/given";
import type { Facts } from "../pure/metadata";
import type { Shown, View } from "../studio";

const FIELDS: GivenName[] = ["time", "utc_offset", "lat", "lon", "heading", "fov", "headings"];

export class FactsView {
  private readonly form = byId<HTMLFormElement>("given");
  private facts: Facts = {};

  constructor(asked: (given: Given) => void) {
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      asked(givenBy(this.read(), this.facts));
    });
    byId("forget").addEventListener("click", () => asked(NOTHING));
  }

  show({ views, given }: Shown, { photo, answer }: View): void {
    this.facts = photo.facts;
    const used = usedUnseen(
      answer.evidence,
      given,
      views.map((view) => view.photo.facts),
    );
    byId("facts").replaceChildren(
      ...[...said(photo.facts, used), held(answer, given)].map(({ name, value }) =>
        make("div", {}, make("dt", { textContent: name }), make("dd", { textContent: value })),
      ),
    );
    byId("evidence").textContent = evidenceWords(answer.evidence);
    byId("warnings").replaceChildren(...answer.warnings.map((textContent) => make("li", { textContent })));
    byId("warnings").hidden = answer.warnings.length === 0;
    const several = views.length > 1;
    byId("field-headings").hidden = !several;
    byId("field-heading").hidden = several;
    this.fill(formValues(photo.facts, given), answer.camera.vertical_fov);
    byId<HTMLButtonElement>("forget").disabled = JSON.stringify(given) === JSON.stringify(NOTHING);
  }

  private fill(given: Given, fov: number): void {
    for (const name of FIELDS) this.input(name).value = given[name];
    this.input("fov").placeholder = `${fov.toFixed(1)} (estimated)`;
    byId<HTMLInputElement>("given-exif").checked = given.exif;
  }

  private read(): Given {
    const said = Object.fromEntries(FIELDS.map((name) => [name, this.input(name).value.trim()]));
    return { ...NOTHING, ...said, exif: byId<HTMLInputElement>("given-exif").checked };
  }

  private input(name: GivenName): HTMLInputElement {
    return byId<HTMLInputElement>(`given-${name}`);
  }
}
