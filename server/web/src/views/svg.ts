/** Small SVG drawings, in the units of their own viewBox. */

import type { Point } from "../pure/camera";

const NAMESPACE = "http://www.w3.org/2000/svg";

export function svg(
  name: string,
  attributes: Record<string, string | number>,
  ...children: (Node | string)[]
): SVGElement {
  const element = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.append(...children);
  return element;
}

export function path(points: readonly Point[], kind: string): SVGElement {
  return svg("path", { d: `M${points.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join("L")}`, class: kind });
}

export function text([x, y]: Point, words: string, kind: string): SVGElement {
  return svg("text", { x: x.toFixed(1), y: y.toFixed(1), class: kind }, words);
}

/** A disc with eight rays around it; `size` is the disc's radius. */
export function sunSign([x, y]: Point, size: number, kind: string): SVGElement {
  const rays = Array.from({ length: 8 }, (_, i) => {
    const [c, s] = [Math.cos((i * Math.PI) / 4), Math.sin((i * Math.PI) / 4)];
    return `M${(1.6 * size * c).toFixed(2)} ${(1.6 * size * s).toFixed(2)}L${(2.3 * size * c).toFixed(2)} ${(2.3 * size * s).toFixed(2)}`;
  });
  const layer = (grow: number, kind: string): SVGElement =>
    svg(
      "g",
      { class: kind, "stroke-width": size / 3 + 2 * grow, "stroke-linecap": "round" },
      svg("path", { d: rays.join("") }),
      svg("circle", { r: size + grow, "stroke-width": 0 }),
    );
  const place = `translate(${x.toFixed(2)} ${y.toFixed(2)})`;
  return svg("g", { transform: place }, layer(size / 4, "shade"), layer(0, kind));
}

/** Draws into an SVG in CSS pixels, again whenever its size changes. */
export function fitted(element: SVGSVGElement, draw: (width: number, height: number) => Node[]): () => void {
  const redraw = (): void => {
    const { width, height } = element.getBoundingClientRect();
    if (width < 1 || height < 1) return;
    element.setAttribute("viewBox", `0 0 ${width} ${height}`);
    element.replaceChildren(...draw(width, height));
  };
  new ResizeObserver(redraw).observe(element);
  return redraw;
}
