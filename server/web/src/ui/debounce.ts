/** Calls that follow one another faster than they can be answered. */

/**
 * A function that waits for `delay` milliseconds of quiet, then runs `work`; a newer call aborts the one under way.
 * An abort is no failure; whatever else `work` throws goes to `failed`.
 */
export function debounceLatest<T>(
  work: (value: T, signal: AbortSignal) => Promise<void>,
  delay: number,
  onError: (error: unknown) => void,
): (value: T) => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let running = new AbortController();
  return (value) => {
    clearTimeout(timer);
    running.abort();
    const controller = new AbortController();
    running = controller;
    timer = setTimeout(() => {
      work(value, controller.signal).catch((error) => {
        if (!controller.signal.aborted) onError(error);
      });
    }, delay);
  };
}
