/** The loupe: the photo under a finger, enlarged beside it. */

import { byId } from "../dom";
import { clamp } from "../geometry/angles";
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

  /** Shows the photo around a point, above it or, near the upper edge, beside it; sizes in CSS pixels. */
  show(picture: HTMLCanvasElement, [x, y]: Point, { width, height }: Size): void {
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const middle = LOUPE / 2;
    const scale = picture.width / width;
    const side = (LOUPE / ZOOM) * scale;
    this.canvas.hidden = false;
    const hasRoom = y > AWAY + middle;
    const across = hasRoom ? x : x + (x < width / 2 ? AWAY : -AWAY);
    this.canvas.style.left = `${clamp(across - middle, 0, width - LOUPE)}px`;
    this.canvas.style.top = `${clamp((hasRoom ? y - AWAY : y) - middle, 0, height - LOUPE)}px`;
    context.fillStyle = "#000";
    context.fillRect(0, 0, LOUPE, LOUPE);
    context.drawImage(picture, x * scale - side / 2, y * scale - side / 2, side, side, 0, 0, LOUPE, LOUPE);
    context.strokeStyle = "#fff";
    context.beginPath();
    context.moveTo(middle, middle - CROSS);
    context.lineTo(middle, middle + CROSS);
    context.moveTo(middle - CROSS, middle);
    context.lineTo(middle + CROSS, middle);
    context.stroke();
  }
}
