/** The table of the estimate's numbers. */

import { accuracy, type Lighting } from "../api";
import { byId, make } from "../dom";
import { type Named, numbers } from "../pure/words";

const NOTE = "± is the median error on photos that the network never saw.";

let errors: Promise<Record<string, number>> | undefined;

/** The numbers at once, their errors as soon as the service has told them. */
export async function showNumbers(lighting: Lighting): Promise<void> {
  fill(numbers(lighting));
  errors ??= accuracy().catch(() => ({}));
  const stated = numbers(lighting, await errors);
  byId("numbers-note").textContent = stated.some(({ note }) => note) ? NOTE : "";
  fill(stated);
}

function fill(rows: Named[]): void {
  byId("numbers").replaceChildren(
    ...rows.map(({ name, value, note = "" }) =>
      make("div", {}, make("dt", { textContent: name }), make("dd", {}, value, make("small", { textContent: note }))),
    ),
  );
}
