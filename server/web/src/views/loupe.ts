/** The loupe: the photo under a finger, enlarged beside it. */

import { byId } from "../dom";
import type { Point, Size } from "../geometry/camera";

const LOUPE = 128; // CSS pixels
const ZOOM = 2.5;
const AWAY = 96; // CSS pixels from the finger to the loupe's middle
const CROSS = 12; // CSS pixels of each arm of the cross

export class Loupe {
  private readonly canvas = byId<HTMLCanvasElement>("loupe");

  hide(): void {
    this.canvas.hidden = true;
  }

  /** Shows the photo around a point, above the finger or, near the upper edge, below it; sizes in CSS pixels. */
  show(picture: HTMLCanvasElement, [x, y]: Point, { width, height }: Size): void {
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const scale = picture.width / width;
    const side = (LOUPE / ZOOM) * scale;
    this.canvas.hidden = false;
    this.canvas.style.left = `${Math.min(Math.max(x - LOUPE / 2, 0), width - LOUPE)}px`;
    this.canvas.style.top = `${(y > AWAY + LOUPE / 2 ? y - AWAY : Math.min(y + AWAY, height - LOUPE / 2)) - LOUPE / 2}px`;
    context.fillStyle = "#000";
    context.fillRect(0, 0, LOUPE, LOUPE);
    context.drawImage(picture, x * scale - side / 2, y * scale - side / 2, side, side, 0, 0, LOUPE, LOUPE);
    const middle = LOUPE / 2;
    context.strokeStyle = "#fff";
    context.beginPath();
    context.moveTo(middle, middle - CROSS);
    context.lineTo(middle, middle + CROSS);
    context.moveTo(middle - CROSS, middle);
    context.lineTo(middle + CROSS, middle);
    context.stroke();
  }
}
