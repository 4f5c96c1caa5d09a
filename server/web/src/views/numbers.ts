/** The table of the estimate's numbers. */

import type { Lighting } from "../api";
import { byId, make } from "../dom";
import { numbers } from "../pure/words";

export function showNumbers(lighting: Lighting): void {
  const rows = numbers(lighting).map(({ name, value, note }) =>
    make(
      "div",
      {},
      make("dt", { textContent: name }),
      make("dd", { textContent: value }, ...(note ? [make("small", { textContent: note })] : [])),
    ),
  );
  byId("numbers").replaceChildren(...rows);
}
