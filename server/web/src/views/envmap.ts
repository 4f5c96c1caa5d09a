/** The environment map on show: a draft of the sky until the light has come to rest, then as the service exports it. */

import { debounceLatest, fetchEnvmap } from "../api";
import { byId } from "../dom";
import type { SkyRequest } from "../sky/lighting";
import { LIGHT_ROWS, type MapPicture } from "../sky/render";
import { lightOverrides, type PhotoView, skyRequest } from "../state";
import type { LightOverrides } from "../types";

const REST = 350; // ms without a change of the light
const PICTURE_ROWS = [256, 512] as const; // of the map for people, in narrow and in wide places
const NARROW = 620; // pixels of the screen
const NEARLY_IN_SIGHT = "200px";
const SHOWN = "This is the map that you download. The photo's view is outlined.";
const PENDING = "The service renders the map in this light…";

/** A map of the light that a view had when it was asked for. */
interface Wanted {
  view: PhotoView;
  key: string; // of the light
  question: SkyRequest;
  overrides: LightOverrides | undefined;
}

export class EnvmapView {
  private readonly canvas = byId<HTMLCanvasElement>("envmap");
  private readonly fetch = debounceLatest<Wanted>(
    (wanted, signal) => this.load(wanted, signal),
    REST,
    (error) => this.fail(error),
  );
  private key = ""; // of the light on show
  private pending = ""; // what is being fetched
  private failed = ""; // what could not be
  private inSight = false;
  private latest: PhotoView | undefined;

  /** `hasObject` tells whether a map has an object to light; `onLight` gets the view whose map has come for that. */
  constructor(
    private readonly hasObject: () => boolean,
    private readonly onLight: (view: PhotoView) => void,
  ) {
    new IntersectionObserver(
      ([entry]) => {
        this.inSight = entry?.isIntersecting ?? false;
        if (this.inSight && this.latest) this.request(this.latest);
      },
      { rootMargin: NEARLY_IN_SIGHT },
    ).observe(this.canvas);
  }

  /** Whether the picture of the light on show is here; what is missing, and in sight, is fetched. */
  request(view: PhotoView): boolean {
    this.latest = view;
    const overrides = lightOverrides(view);
    const key = JSON.stringify([view.photo.url, overrides ?? "estimate"]);
    this.key = key;
    if (view.exported?.key !== key) this.note(PENDING, true);
    const needed = `${key} ${this.needsLight(view, key)} ${this.needsPicture(view, key)}`;
    if (needed.endsWith("false false")) this.pending = "";
    else if (needed !== this.pending && needed !== this.failed) {
      this.pending = needed;
      this.fetch({ view, key, question: skyRequest(view), overrides });
    }
    const picture = view.exported?.key === key ? view.exported.picture : undefined;
    if (picture) this.draw(picture);
    return picture !== undefined;
  }

  private needsLight({ exported }: PhotoView, key: string): boolean {
    return this.hasObject() && !(exported?.key === key && exported.light);
  }

  private needsPicture({ exported }: PhotoView, key: string): boolean {
    return this.inSight && !(exported?.key === key && exported.picture);
  }

  /** Shows the sky alone, until the service has rendered the map. */
  drawDraft({ data, width, height }: MapPicture): void {
    Object.assign(this.canvas, { width, height });
    this.canvas.getContext("2d")?.putImageData(new ImageData(data, width, height), 0, 0);
  }

  private async load({ view, key, question, overrides }: Wanted, signal: AbortSignal): Promise<void> {
    const get = (format: string, height: number): Promise<Blob> =>
      fetchEnvmap(view.photo.file, view.userInput, { format, height }, overrides, signal);
    if (this.needsLight(view, key)) {
      const { decodeHdr } = await import("../scene/stage");
      const map = await decodeHdr(await get("hdr", LIGHT_ROWS));
      if (signal.aborted || key !== this.key) return;
      view.exported = { ...(view.exported?.key === key ? view.exported : {}), key, light: { map, question } };
      this.onLight(view);
    }
    if (this.needsPicture(view, key)) {
      const wide = this.canvas.getBoundingClientRect().width * devicePixelRatio > NARROW;
      const picture = await createImageBitmap(await get("png", PICTURE_ROWS[wide ? 1 : 0]));
      if (signal.aborted || key !== this.key) return;
      view.exported = { ...(view.exported?.key === key ? view.exported : {}), key, picture };
      this.draw(picture);
    }
    this.pending = "";
  }

  private draw(picture: ImageBitmap): void {
    Object.assign(this.canvas, { width: picture.width, height: picture.height });
    this.canvas.getContext("2d")?.drawImage(picture, 0, 0);
    this.note(SHOWN, false);
  }

  private note(text: string, busy: boolean): void {
    byId("map-note").textContent = text;
    this.canvas.setAttribute("aria-busy", String(busy));
  }

  private fail(error: unknown): void {
    this.failed = this.pending;
    this.pending = "";
    const reason = error instanceof Error ? error.message : String(error);
    this.note(`The service did not render this map, so only the sky is shown. ${reason}`, false);
  }
}
