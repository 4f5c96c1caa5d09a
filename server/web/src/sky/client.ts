/** The page's side of the worker: one question at a time, and of those that wait only the newest. */

import type { SkyRequest } from "./lighting";
import type { ExportedLight, SkyAnswer, SkyMessage } from "./worker";

const NOT_LOADED = "The sky could not be loaded, so no light is shown. Load the page again.";

export class SkyClient {
  private worker: Worker | undefined;
  private requests = 0;
  private busy = false;
  private unavailable = false; // whether the worker never began
  private answered = true; // whether the newest question that came back has an answer
  private newest: SkyRequest | undefined;
  private waiting: SkyRequest | undefined;
  private idle: (() => void)[] = [];

  constructor(
    private readonly onAnswer: (answer: SkyAnswer) => void,
    private readonly onError: (error: unknown) => void,
  ) {}

  /** The worker, which begins with the first photo. */
  start(): Worker {
    if (this.worker) return this.worker;
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    worker.addEventListener("message", ({ data }: MessageEvent<SkyAnswer | { id: number; error: string }>) => {
      this.busy = false;
      this.answered = !("error" in data);
      const next = this.waiting;
      this.waiting = undefined;
      if (next) this.request(next);
      if ("error" in data) this.onError(new Error(data.error));
      else this.onAnswer(data);
      this.release();
    });
    worker.addEventListener("error", ({ message }) => {
      this.busy = false;
      this.answered = false;
      this.unavailable ||= !message; // a worker that runs states what went wrong
      this.onError(new Error(message || NOT_LOADED));
      this.release();
    });
    this.worker = worker;
    return worker;
  }

  /** Tells those who wait that nothing is being answered any more. */
  private release(): void {
    if (!this.busy) for (const resolve of this.idle.splice(0)) resolve();
  }

  /** The exported map that answers show from now on; null: none yet. */
  setExported(exported: ExportedLight | null): void {
    this.post({ exported });
  }

  request(question: SkyRequest): void {
    this.newest = question;
    if (this.unavailable) {
      this.onError(new Error(NOT_LOADED));
      return;
    }
    if (this.busy) {
      this.waiting = question;
      return;
    }
    this.busy = true;
    this.post({ question, id: ++this.requests });
  }

  /** Waits until the newest question is answered, and asks it once more if that failed; whether there is an answer. */
  async settled(): Promise<boolean> {
    if (!this.busy && !this.answered && this.newest) this.request(this.newest);
    if (this.busy) await new Promise<void>((resolve) => this.idle.push(resolve));
    return this.answered;
  }

  private post(message: SkyMessage): void {
    this.start().postMessage(message);
  }
}
