/** Buttons that copy the light on show as a command or a program, and the text itself for whoever cannot copy. */

import { byId } from "../dom";
import { curlOf, pythonOf, type Subject } from "../pure/snippets";

const MAKERS = { curl: curlOf, python: pythonOf } as const;
type Kind = keyof typeof MAKERS;

export function listenForCopies(subject: () => Promise<Subject | undefined>): void {
  byId("size").addEventListener("change", forgetCopy);
  for (const kind of Object.keys(MAKERS) as Kind[]) {
    byId(`copy-${kind}`).addEventListener("click", async () => {
      const what = await subject();
      if (what) copy(MAKERS[kind](what), kind);
    });
  }
}

/** Takes a copied text away once another light, photo or size is on show. */
export function forgetCopy(): void {
  byId("snippet-box").hidden = true;
}

async function copy(words: string, kind: Kind): Promise<void> {
  const shown = byId<HTMLTextAreaElement>("snippet");
  shown.value = words;
  byId("snippet-box").hidden = false;
  const name = kind === "curl" ? "The curl command" : "The Python program";
  try {
    await navigator.clipboard.writeText(words);
    byId("copied").textContent = `${name} is copied.`;
  } catch {
    shown.select();
    byId("copied").textContent = `${name} is selected: press Ctrl+C.`;
  }
}
