/** The page's elements by their ids, arrow keys, and small SVG drawings in the units of their own viewBox. */

import type { Point } from "./geometry/camera";

export function byId<T extends Element = HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (!element) throw new Error(`The page has no #${id}.`);
  return element as Element as T;
}

export function createElement<K extends keyof HTMLElementTagNameMap>(
  name: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}

/** Whether the device is worked by fingers, as phones are: nothing is dropped, pointed at or typed. */
export const isTouchDevice = (): boolean => matchMedia("(hover: none)").matches;

/** A row of radio buttons, the first one chosen, named by their values unless `labels` says otherwise. */
export function addRadioButtons<T extends string>(
  root: HTMLElement,
  values: readonly T[],
  onChoice: (value: T) => void,
  labels: Partial<Record<T, string>> = {},
): void {
  values.forEach((value, i) => {
    const findRadio = createElement("input", { type: "radio", name: root.id, value, defaultChecked: i === 0 });
    findRadio.addEventListener("change", () => onChoice(value));
    root.append(createElement("label", {}, findRadio, createElement("span", { textContent: labels[value] ?? value })));
  });
}

/** The radio button of a value. */
export function findRadio(root: HTMLElement, value: string): HTMLInputElement {
  const button = [...root.querySelectorAll("input")].find((input) => input.value === value);
  if (!button) throw new Error(`There is no ${value} in #${root.id}.`);
  return button;
}

/** How far an arrow key goes, to the right and up; undefined for any other key, and beside Ctrl, Alt or Meta. */
export function arrowStep({ key, ctrlKey, altKey, metaKey }: KeyboardEvent, step: number): Point | undefined {
  if (ctrlKey || altKey || metaKey) return undefined;
  const steps: Record<string, Point> = {
    ArrowLeft: [-step, 0],
    ArrowRight: [step, 0],
    ArrowUp: [0, step],
    ArrowDown: [0, -step],
  };
  return steps[key];
}

const NAMESPACE = "http://www.w3.org/2000/svg";

export function createSvg(
  name: string,
  attributes: Record<string, string | number>,
  ...children: (Node | string)[]
): SVGElement {
  const element = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.append(...children);
  return element;
}

export function drawPath(points: readonly Point[], kind: string): SVGElement {
  return createSvg("path", {
    d: `M${points.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join("L")}`,
    class: kind,
  });
}

export function drawText([x, y]: Point, content: string, kind: string): SVGElement {
  return createSvg("text", { x: x.toFixed(1), y: y.toFixed(1), class: kind }, content);
}

/** A disc with eight rays around it; `size` is the disc's radius. */
export function drawSun([x, y]: Point, size: number, kind: string): SVGElement {
  const rays = Array.from({ length: 8 }, (_, i) => {
    const [c, s] = [Math.cos((i * Math.PI) / 4), Math.sin((i * Math.PI) / 4)];
    return `M${(1.6 * size * c).toFixed(2)} ${(1.6 * size * s).toFixed(2)}L${(2.3 * size * c).toFixed(2)} ${(2.3 * size * s).toFixed(2)}`;
  });
  const layer = (grow: number, kind: string): SVGElement =>
    createSvg(
      "g",
      { class: kind, "stroke-width": size / 3 + 2 * grow, "stroke-linecap": "round" },
      createSvg("path", { d: rays.join("") }),
      createSvg("circle", { r: size + grow, "stroke-width": 0 }),
    );
  const position = `translate(${x.toFixed(2)} ${y.toFixed(2)})`;
  return createSvg("g", { transform: position }, layer(size / 4, "shade"), layer(0, kind));
}

/** Draws into an SVG in CSS pixels, with the next frame, and again whenever its size changes. */
export function fitDrawing(element: SVGSVGElement, draw: (width: number, height: number) => Node[]): () => void {
  let size = { width: 0, height: 0 };
  let scheduled = false;
  const redraw = (): void => {
    scheduled = false;
    const { width, height } = size;
    if (width < 1 || height < 1) return;
    element.setAttribute("viewBox", `0 0 ${width} ${height}`);
    element.replaceChildren(...draw(width, height));
  };
  new ResizeObserver(() => {
    size = element.getBoundingClientRect();
    redraw();
  }).observe(element);
  return () => {
    if (!scheduled) requestAnimationFrame(redraw);
    scheduled = true;
  };
}
