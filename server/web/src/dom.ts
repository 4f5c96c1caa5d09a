/** The page's elements by their ids. */

export function byId<T extends Element = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`The page has no #${id}.`);
  return element as Element as T;
}

export function make<K extends keyof HTMLElementTagNameMap>(
  name: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}

/** Whether the device is worked by fingers, as phones are: nothing is dropped, pointed at or typed. */
export const byTouch = (): boolean => matchMedia("(hover: none)").matches;

/** A row of radio buttons, the first one chosen. */
export function choices<T extends string>(root: HTMLElement, values: readonly T[], chosen: (value: T) => void): void {
  values.forEach((value, i) => {
    const radio = make("input", { type: "radio", name: root.id, value, defaultChecked: i === 0 });
    radio.addEventListener("change", () => chosen(value));
    root.append(make("label", {}, radio, make("span", { textContent: value })));
  });
}

/** The radio button of a value. */
export function radio(root: HTMLElement, value: string): HTMLInputElement {
  const found = [...root.querySelectorAll("input")].find((input) => input.value === value);
  if (!found) throw new Error(`There is no ${value} in #${root.id}.`);
  return found;
}
