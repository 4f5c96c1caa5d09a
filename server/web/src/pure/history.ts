/** What was done, to be undone: states one after another. */

const TOGETHER = 800; // ms within which changes of the same kind count as one

export class History<State> {
  private past: State[] = [];
  private future: State[] = [];
  private kind = "";
  private last = Number.NEGATIVE_INFINITY;

  constructor(
    private now: State,
    private readonly clock: () => number = () => performance.now(),
  ) {}

  get state(): State {
    return this.now;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /** A new state; steps of one `kind` in quick succession, as of a slider, are undone together. */
  push(state: State, kind: string): void {
    const time = this.clock();
    if (kind !== this.kind || time - this.last > TOGETHER || this.past.length === 0) this.past.push(this.now);
    this.kind = kind;
    this.last = time;
    this.future = [];
    this.now = state;
  }

  undo(): State {
    const before = this.past.pop();
    if (before !== undefined) {
      this.future.push(this.now);
      this.now = before;
    }
    this.kind = "";
    return this.now;
  }

  redo(): State {
    const after = this.future.pop();
    if (after !== undefined) {
      this.past.push(this.now);
      this.now = after;
    }
    this.kind = "";
    return this.now;
  }
}
