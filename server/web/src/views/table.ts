/** Photos that came at once: a table of their suns and of how far each can be trusted, in which each opens as one. */

import { type Estimate, estimatePhotos } from "../api";
import { byId, createElement } from "../dom";
import type { History } from "../history";
import type { PhotoSource } from "../photo";
import type { Session } from "../state";
import { buildHeadline } from "../text/format";
import { NO_USER_INPUT } from "../text/metadata";

const THUMB = 96; // pixels of the width

/** A photo of the table. */
export interface Row {
  source: PhotoSource;
  estimate?: Estimate; // the first answer, by the file alone
  answers?: History<Session>; // once it was opened
}

export class PhotoTable {
  private readonly body = byId<HTMLTableSectionElement>("table-rows");
  private rows: { row: Row; line: HTMLTableRowElement }[] = [];
  private asking = new AbortController();
  private untouched = true; // whether nothing of it was opened

  constructor(
    private readonly onOpen: (row: Row) => void,
    together: (sources: PhotoSource[]) => void,
  ) {
    byId("together").addEventListener("click", () => {
      this.untouched = false;
      together(this.rows.map(({ row }) => row.source));
    });
  }

  /** Whether photos with their answers stay open in it. */
  holds = (answers: History<Session> | undefined): boolean => this.rows.some(({ row }) => row.answers === answers);

  /** Lists other photos, or none, and asks for the light of one after another; the first answer is opened. */
  async show(sources: PhotoSource[]): Promise<void> {
    this.asking.abort();
    this.asking = new AbortController();
    const { signal } = this.asking;
    this.untouched = true;
    this.rows = sources.map((source) => this.createRow({ source }));
    this.body.replaceChildren(...this.rows.map(({ line }) => line));
    byId("table").hidden = sources.length === 0;
    for (const { row, line } of this.rows) {
      await this.ask(row, line, signal);
      if (signal.aborted) return;
      if (row.estimate && this.untouched) this.open(row);
    }
  }

  private open(row: Row): void {
    this.untouched = false;
    this.onOpen(row);
  }

  /** Marks the row that is open, and says what its newest answer says. */
  mark(answers: History<Session> | undefined): void {
    for (const { row, line } of this.rows) {
      const isOpen = answers !== undefined && row.answers === answers;
      line.querySelector("button")?.setAttribute("aria-pressed", String(isOpen));
      const view = isOpen && answers.state.views[0];
      if (view) describe(line, view.estimate);
    }
  }

  private createRow(row: Row): { row: Row; line: HTMLTableRowElement } {
    const name = createElement("button", { type: "button", textContent: row.source.name });
    name.setAttribute("aria-pressed", "false");
    name.addEventListener("click", () => this.open(row));
    const cells = [createElement("td"), createElement("td", {}, name), createElement("td"), createElement("td")];
    return { row, line: createElement("tr", {}, ...cells) };
  }

  private async ask(row: Row, line: HTMLTableRowElement, signal: AbortSignal): Promise<void> {
    const [picture, , sun] = line.cells;
    try {
      const file = await row.source.load(signal);
      picture?.replaceChildren(...(await drawThumb(file)));
      const [estimate] = await estimatePhotos([file], NO_USER_INPUT, signal);
      if (!estimate) return;
      row.estimate = estimate;
      if (!row.answers) describe(line, estimate);
    } catch (error) {
      if (sun) sun.textContent = error instanceof Error ? error.message : String(error);
    }
  }
}

/** Writes the sun and the word of trust. */
function describe({ cells: [, , sun, trust] }: HTMLTableRowElement, estimate: Estimate): void {
  if (sun) sun.textContent = buildHeadline(estimate).title;
  trust?.replaceChildren(
    ...(estimate.trust
      ? [
          createElement("span", {
            className: `trust ${estimate.trust.replace(" ", "-")}`,
            textContent: estimate.trust,
          }),
        ]
      : []),
  );
}

/** A small picture; none where this browser cannot decode the file. */
async function drawThumb(file: File): Promise<HTMLCanvasElement[]> {
  const image = await createImageBitmap(file, { resizeWidth: THUMB }).catch(() => null);
  if (!image) return [];
  const canvas = createElement("canvas", { width: image.width, height: image.height });
  canvas.getContext("2d")?.drawImage(image, 0, 0);
  image.close();
  return [canvas];
}
