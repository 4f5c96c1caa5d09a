/** What the service says of itself, asked for once. */

import { type Described, description } from "./api";

let told: Promise<Described | undefined> | undefined;

/** Undefined where the service does not say it, as without a key; then it is asked again the next time. */
export function described(): Promise<Described | undefined> {
  told ??= description().catch(() => {
    told = undefined;
    return undefined;
  });
  return told;
}
