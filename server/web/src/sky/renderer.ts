/** The page's side of the worker: one question at a time, and of those that wait only the newest. */

import type { Factors } from "../picture/factors";
import type { Pixels } from "../picture/pixels";
import type { Camera } from "../pure/camera";
import type { Question } from "./light";
import type { Answer, Message } from "./worker";

export class SkyRenderer {
  private readonly worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  private asked = 0;
  private busy = false;
  private waiting: Question | undefined;
  private idle: (() => void)[] = [];

  constructor(
    private readonly shown: (answer: Answer) => void,
    private readonly failed: (error: unknown) => void,
  ) {
    this.worker.addEventListener("message", ({ data }: MessageEvent<Answer | { id: number; error: string }>) => {
      this.busy = false;
      const next = this.waiting;
      this.waiting = undefined;
      if (next) this.ask(next);
      if ("error" in data) this.failed(new Error(data.error));
      else this.shown(data);
      this.release();
    });
    this.worker.addEventListener("error", ({ message }) => {
      this.busy = false;
      this.failed(new Error(message));
      this.release();
    });
  }

  /** Tells those who wait that nothing is being answered any more. */
  private release(): void {
    if (!this.busy) for (const tell of this.idle.splice(0)) tell();
  }

  /** What stands around the camera from now on. */
  setPhoto(photo: Pixels, camera: Camera, factors: Factors | undefined): void {
    this.post({ photo, camera, factors });
  }

  ask(question: Question): void {
    if (this.busy) {
      this.waiting = question;
      return;
    }
    this.busy = true;
    this.post({ question, id: ++this.asked });
  }

  /** Waits until the newest question is answered. */
  settled(): Promise<void> {
    return this.busy ? new Promise((resolve) => this.idle.push(resolve)) : Promise.resolve();
  }

  private post(message: Message): void {
    this.worker.postMessage(message);
  }
}
