/** The table of the estimate's numbers. */

import type { Lighting } from "../api";
import { described } from "../described";
import { byId, make } from "../dom";
import { explained, type Named, numbers } from "../pure/words";

/** The numbers at once, their errors as soon as the service has told them. */
export async function showNumbers(lighting: Lighting): Promise<void> {
  fill(numbers(lighting));
  const accuracy = (await described())?.accuracy ?? {};
  const known = accuracy.phone ?? Object.values(accuracy)[0] ?? {};
  byId("numbers-note").textContent = explained(lighting, known);
  fill(numbers(lighting, known));
}

/** A row of the table. */
function line(name: string, value: string, note: string): DocumentFragment {
  const row = document.createDocumentFragment();
  row.append(make("dt", { textContent: name }), make("dd", {}, value, make("small", { textContent: note })));
  return row;
}

function fill(rows: Named[]): void {
  const stated = rows.some(({ note }) => note?.startsWith("±"));
  byId("numbers").replaceChildren(
    ...(stated ? [make("div", { className: "head" }, line("", "this photo", "usual error"))] : []),
    ...rows.map(({ name, value, note = "" }) => make("div", {}, line(name, value, note))),
  );
}
