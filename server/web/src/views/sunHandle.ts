/** The sun in the picture, as something to take hold of: by mouse, by finger, by keys. */

import type { LightParameters } from "../api";
import { byId } from "../dom";
import { type Angles, angles, clamp, direction, wrapAzimuth } from "../geometry/angles";
import { type Camera, pixelRay, sunMark } from "../geometry/camera";
import { formatAzimuth } from "../text/format";

const EDGE = 12; // pixels from the picture's edge to the mark of a sun outside of it
const ELEVATIONS = [-4, 90] as const; // degrees, of the slider
const STEP = 1; // degrees of a key; with Shift five of them
const ACROSS = 180; // degrees of azimuth that the width of the picture drags a sun outside of it
const DOWN = 90; // degrees of elevation, so by the height

/** Where a drag began. */
interface Drag {
  x: number;
  y: number;
  sun: Angles;
  inside: boolean;
}

export class SunHandle {
  private readonly handle = byId("sun-handle");
  private readonly frame = byId("frame");
  private camera: Camera | undefined;
  private sun: Angles = { azimuth: 0, elevation: 0 };
  private drag: Drag | undefined;

  constructor(private readonly onMove: (sun: Angles) => void) {
    new ResizeObserver(() => this.place()).observe(this.frame);
    this.handle.addEventListener("pointerdown", (event) => this.begin(event));
    this.handle.addEventListener("pointermove", (event) => this.follow(event));
    for (const end of ["pointerup", "pointercancel"] as const) {
      this.handle.addEventListener(end, () => {
        this.drag = undefined;
      });
    }
    this.handle.addEventListener("keydown", (event) => this.key(event));
  }

  /** Shows the sun of a light, in the picture of a camera. */
  show(camera: Camera, { sun_azimuth, sun_elevation }: LightParameters): void {
    this.camera = camera;
    this.sun = { azimuth: sun_azimuth, elevation: sun_elevation };
    this.handle.setAttribute("aria-valuenow", String(Math.round(sun_azimuth)));
    this.handle.setAttribute("aria-valuetext", `${formatAzimuth(sun_azimuth)}, ${sun_elevation.toFixed(0)}° high`);
    this.place();
  }

  private mark(): { x: number; y: number; inside: boolean } | undefined {
    const { width, height } = this.frame.getBoundingClientRect();
    if (!this.camera || width < 1) return undefined;
    const { point, inside } = sunMark(
      direction(this.sun.azimuth, this.sun.elevation),
      this.camera,
      { width, height },
      EDGE,
    );
    return { x: point[0], y: point[1], inside };
  }

  private place(): void {
    const at = this.mark();
    if (at) Object.assign(this.handle.style, { left: `${at.x}px`, top: `${at.y}px` });
  }

  private begin(event: PointerEvent): void {
    const at = this.mark();
    if (!at || event.button !== 0) return;
    event.preventDefault();
    this.handle.focus({ preventScroll: true });
    this.handle.setPointerCapture(event.pointerId);
    this.drag = { x: event.clientX, y: event.clientY, sun: this.sun, inside: at.inside };
  }

  /** A sun in the picture is where the pointer is; one outside of it is dragged by how far the pointer goes. */
  private follow(event: PointerEvent): void {
    if (!this.drag || !this.camera) return;
    const { left, top, width, height } = this.frame.getBoundingClientRect();
    if (this.drag.inside) {
      const ray = pixelRay([event.clientX - left, event.clientY - top], this.camera, { width, height });
      const length = Math.hypot(...ray);
      this.move(angles([ray[0] / length, ray[1] / length, ray[2] / length]));
    } else {
      const { azimuth, elevation } = this.drag.sun;
      const right = (ACROSS * (event.clientX - this.drag.x)) / width;
      const up = (DOWN * (this.drag.y - event.clientY)) / height;
      this.move({ azimuth: azimuth + right, elevation: elevation + up });
    }
  }

  private move({ azimuth, elevation }: Angles): void {
    const sun = { azimuth: wrapAzimuth(azimuth), elevation: clamp(elevation, ...ELEVATIONS) };
    if (sun.azimuth !== this.sun.azimuth || sun.elevation !== this.sun.elevation) this.onMove(sun);
  }

  private key(event: KeyboardEvent): void {
    const step = event.shiftKey ? 5 * STEP : STEP;
    const steps: Record<string, readonly [number, number]> = {
      ArrowLeft: [-step, 0],
      ArrowRight: [step, 0],
      ArrowUp: [0, step],
      ArrowDown: [0, -step],
    };
    const by = steps[event.key];
    if (!by || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.move({ azimuth: this.sun.azimuth + by[0], elevation: this.sun.elevation + by[1] });
  }
}
