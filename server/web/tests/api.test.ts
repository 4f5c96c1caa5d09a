import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import {
  apiKey,
  debounceLatest,
  type Estimate,
  estimatePhotos,
  fetchEnvmap,
  fetchExample,
  fetchPreview,
  fetchScene,
  modelInfo,
  type ServiceError,
  storeKey,
} from "../src/api";
import { NO_USER_INPUT } from "../src/text/metadata";

const stored = new Map<string, string>();

beforeEach(() => {
  stored.clear();
  vi.stubGlobal("sessionStorage", {
    getItem: (name: string) => stored.get(name) ?? null,
    setItem: (name: string, value: string) => stored.set(name, value),
  });
});

afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

function stubAnswer(body: BodyInit, status: number): void {
  vi.stubGlobal("fetch", vi.fn().mockResolvedValue(new Response(body, { status })));
}

const catchError = (): Promise<ServiceError> =>
  fetchExample("street.jpg", new AbortController().signal).then(
    () => expect.fail("no refusal"),
    (error: ServiceError) => error,
  );

/** The address and the body of the only request. */
const onlyRequest = (): [string, RequestInit & { body: FormData }] =>
  vi.mocked(fetch).mock.calls[0] as [string, RequestInit & { body: FormData }];

describe("the service", () => {
  it("is asked for a map of the light that replaces the estimated one", async () => {
    stubAnswer("map", 200);
    const overrides = {
      sun_azimuth: -41.23456789,
      sun_elevation: 33,
      turbidity: 3.4,
      sky_exposure: 2e-6,
      ground_albedo: 0.3,
      ...{ sun: true, warmth: 0.5, softness: 0.2 },
    };
    await fetchEnvmap(new Blob(["x"]), NO_USER_INPUT, { format: "hdr", height: 256 }, overrides);
    expect(onlyRequest()[0]).toBe(
      "v1/envmap?sun_azimuth=-41.2346&sun_elevation=33&turbidity=3.4&sky_exposure=0.000002&sun=true&format=hdr&height=256",
    );
  });

  it("gets the photo as one field of a form, and the key where there is one", async () => {
    stubAnswer("{}", 200);
    stored.set("lighting-api-key", "secret");
    const answers = await estimatePhotos(
      [new File(["x"], "street.jpg", { type: "image/jpeg" })],
      NO_USER_INPUT,
      new AbortController().signal,
    );
    const [url, { body, headers }] = onlyRequest();
    expect(answers).toEqual([{}]);
    expect(url).toBe("v1/lighting?probability=true&photo_metadata=true");
    expect([...body.keys()]).toEqual(["photo"]);
    expect(headers).toEqual({ Authorization: "Bearer secret" });
  });

  it("gets several photos of one place in one form, with what is said of them", async () => {
    stubAnswer(JSON.stringify({ lightings: [{ evidence: ["pixels"] }, { evidence: [] }] }), 200);
    const photos = [new File(["x"], "street.jpg"), new File(["y"], "lake.jpg")];
    const userInput = { ...NO_USER_INPUT, metadata: false, headings: "0,45", heading: "7", vertical_fov: "50" };
    const answers: Estimate[] = await estimatePhotos(photos, userInput, new AbortController().signal);
    expect(answers.map(({ evidence }) => evidence.length)).toEqual([1, 0]);
    expect(onlyRequest()[0]).toBe(
      "v1/lightings?metadata=false&vertical_fov=50&headings=0%2C45&probability=true&photo_metadata=true",
    );
    expect(onlyRequest()[1].body.getAll("photo")).toHaveLength(2);
  });

  it("makes scenes of the photo, with the light on show where that was changed", async () => {
    stubAnswer("PK", 200);
    const sky = {
      sun_azimuth: 10,
      sun_elevation: 20,
      turbidity: 3,
      sky_exposure: 1.5,
      ground_albedo: 0.3,
      sun: false,
      warmth: 0,
      softness: 0,
    };
    await fetchScene(new Blob(["x"]), { ...NO_USER_INPUT, heading: "87" }, "usd", sky);
    expect(onlyRequest()[0]).toBe(
      "v1/scene?heading=87&sun_azimuth=10&sun_elevation=20&turbidity=3&sky_exposure=1.5&sun=false&for=usd",
    );
  });

  it("draws previews of the light on show", async () => {
    stubAnswer("PNG", 200);
    await fetchPreview(new Blob(["x"]), NO_USER_INPUT, { sun: [40, 25.5], exposure: -1, haze: 3 });
    expect(onlyRequest()[0]).toBe("v1/preview?sun=40%2C25.5&exposure=-1&haze=3");
  });

  it("refuses in its own words", async () => {
    stubAnswer(JSON.stringify({ title: "Too large", detail: "Send less." }), 413);
    const refusal = await catchError();
    expect([refusal.status, refusal.title, refusal.message]).toEqual([413, "Too large", "Send less."]);
  });

  it("names the file that it refuses, but no file where it was not asked properly", async () => {
    const estimate = (): Promise<string> =>
      estimatePhotos([new File(["x"], "notes.txt")], NO_USER_INPUT, new AbortController().signal).then(
        () => expect.fail("no refusal"),
        ({ message }: ServiceError) => message,
      );
    stubAnswer(JSON.stringify({ title: "No photo", detail: "It is text." }), 415);
    expect(await estimate()).toBe("notes.txt: It is text.");
    stubAnswer(JSON.stringify({ title: "No key", detail: "Send a key." }), 401);
    expect(await estimate()).toBe("Send a key.");
  });

  it("says what it has against the photos, not that a parameter is wrong", async () => {
    const errors = [{ field: "photo", place: "form", detail: "At most 8." }];
    stubAnswer(JSON.stringify({ title: "A parameter is wrong", detail: "photo: At most 8.", errors }), 422);
    const refusal = await catchError();
    expect([refusal.title, refusal.message]).toEqual(["These photos cannot be taken", "At most 8."]);
  });

  it("may stand behind a proxy that knows no problem documents", async () => {
    stubAnswer("<html>Bad gateway</html>", 502);
    expect((await catchError()).title).toBe("The service answered 502");
  });

  it("may not be there", async () => {
    vi.stubGlobal("fetch", vi.fn().mockRejectedValue(new TypeError("Failed to fetch")));
    expect((await catchError()).title).toBe("The service did not answer");
  });
});

describe("what the service says of itself", () => {
  it("is asked for until it is told, and then no more", async () => {
    vi.stubGlobal("fetch", vi.fn().mockRejectedValue(new TypeError("Failed to fetch")));
    expect(await modelInfo()).toBeUndefined();
    stubAnswer(JSON.stringify({ accuracy: {}, matching: true }), 200);
    expect((await modelInfo())?.matching).toBe(true);
    expect((await modelInfo())?.matching).toBe(true);
    expect(vi.mocked(fetch)).toHaveBeenCalledTimes(1);
  });
});

describe("an example", () => {
  it("is refused as an own photo is where the service is not there, and is no photo where it has none", async () => {
    vi.stubGlobal("fetch", vi.fn().mockRejectedValue(new TypeError("Failed to fetch")));
    await expect(fetchExample("assets/a.jpg", new AbortController().signal)).rejects.toMatchObject({
      status: 0,
      title: "The service did not answer",
    });
    stubAnswer("<html>Gone</html>", 404);
    await expect(fetchExample("assets/a.jpg", new AbortController().signal)).rejects.toMatchObject({
      title: "The service answered 404",
    });
    stubAnswer("photo", 200);
    expect(await (await fetchExample("assets/a.jpg", new AbortController().signal)).text()).toBe("photo");
  });
});

describe("a key", () => {
  it("is kept where a request can carry it, and never otherwise", () => {
    expect([storeKey("schlüssel"), apiKey()]).toEqual([true, "schlüssel"]);
    expect([storeKey("key“€”"), storeKey("a\nb"), apiKey()]).toEqual([false, false, "schlüssel"]);
  });
});

describe("latest", () => {
  it("does only the last of many calls", async () => {
    vi.useFakeTimers();
    const results: number[] = [];
    const call = debounceLatest<number>(
      async (value) => void results.push(value),
      40,
      (error) => expect.fail(String(error)),
    );
    for (const value of [1, 2, 3]) call(value);
    await vi.advanceTimersByTimeAsync(100);
    expect(results).toEqual([3]);
  });

  it("aborts the call under way, and that is no failure", async () => {
    vi.useFakeTimers();
    const [signals, errors]: [AbortSignal[], unknown[]] = [[], []];
    const wait = (_: number, signal: AbortSignal): Promise<void> =>
      new Promise((_resolve, reject) => {
        signals.push(signal);
        signal.addEventListener("abort", () => reject(signal.reason));
      });
    const call = debounceLatest<number>(wait, 10, (error) => errors.push(error));
    call(1);
    await vi.advanceTimersByTimeAsync(20);
    call(2);
    await vi.advanceTimersByTimeAsync(20);
    expect(signals.map(({ aborted }) => aborted)).toEqual([true, false]);
    expect(errors).toEqual([]);
  });

  it("hands on what goes wrong", async () => {
    vi.useFakeTimers();
    const errors: unknown[] = [];
    const call = debounceLatest<number>(
      async () => Promise.reject(new Error("broken")),
      0,
      (error) => errors.push(error),
    );
    call(1);
    await vi.advanceTimersByTimeAsync(5);
    expect(errors).toEqual([new Error("broken")]);
  });
});
