import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { description, type Estimate, envmapFile, estimate, exampleFile, type Refusal, sceneFile } from "../src/api";
import { described } from "../src/described";
import { apiKey, keepKey } from "../src/key";
import { NOTHING } from "../src/pure/given";
import { latest } from "../src/pure/latest";

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

function answer(body: BodyInit, status: number): void {
  vi.stubGlobal("fetch", vi.fn().mockResolvedValue(new Response(body, { status })));
}

const refusalOf = (): Promise<Refusal> =>
  description().then(
    () => expect.fail("no refusal"),
    (error: Refusal) => error,
  );

/** The address and the body of the only request. */
const request = (): [string, RequestInit & { body: FormData }] =>
  vi.mocked(fetch).mock.calls[0] as [string, RequestInit & { body: FormData }];

describe("the service", () => {
  it("is asked for a map of the light that replaces the estimated one", async () => {
    answer("map", 200);
    const changed = {
      sun_azimuth: -41.23456789,
      sun_elevation: 33,
      turbidity: 3.4,
      exposure: 2e-6,
      ground_albedo: 0.3,
      sun: true,
    };
    await envmapFile(new Blob(["x"]), NOTHING, { format: "hdr", height: 256 }, changed);
    expect(request()[0]).toBe(
      "v1/envmap?sun_azimuth=-41.2346&sun_elevation=33&turbidity=3.4&exposure=0.000002&sun=true&format=hdr&height=256",
    );
  });

  it("gets the photo as one field of a form, and the key where there is one", async () => {
    answer("{}", 200);
    stored.set("lighting-api-key", "secret");
    const answers = await estimate([new Blob(["x"], { type: "image/jpeg" })], NOTHING, new AbortController().signal);
    const [url, { body, headers }] = request();
    expect(answers).toEqual([{}]);
    expect(url).toBe("v1/lighting?probability=true&surroundings=true");
    expect([...body.keys()]).toEqual(["photo"]);
    expect(headers).toEqual({ Authorization: "Bearer secret" });
  });

  it("gets several photos of one place in one form, with what is said of them", async () => {
    answer(JSON.stringify({ lightings: [{ evidence: ["pixels"] }, { evidence: [] }] }), 200);
    const photos = [new Blob(["x"]), new Blob(["y"])];
    const given = { ...NOTHING, exif: false, headings: "0,45", heading: "7", fov: "50" };
    const answers: Estimate[] = await estimate(photos, given, new AbortController().signal);
    expect(answers.map(({ evidence }) => evidence.length)).toEqual([1, 0]);
    expect(request()[0]).toBe("v1/lighting?exif=false&fov=50&headings=0%2C45&probability=true&surroundings=true");
    expect(request()[1].body.getAll("photo")).toHaveLength(2);
  });

  it("makes scenes of the photo, with the light on show where that was changed", async () => {
    answer("PK", 200);
    const sky = { sun_azimuth: 10, sun_elevation: 20, turbidity: 3, exposure: 1.5, ground_albedo: 0.3, sun: false };
    await sceneFile(new Blob(["x"]), { ...NOTHING, heading: "87" }, "usd", sky);
    expect(request()[0]).toBe(
      "v1/scene?heading=87&sun_azimuth=10&sun_elevation=20&turbidity=3&exposure=1.5&sun=false&tool=usd",
    );
  });

  it("refuses in its own words", async () => {
    answer(JSON.stringify({ title: "Too large", detail: "Send less." }), 413);
    const refusal = await refusalOf();
    expect([refusal.status, refusal.title, refusal.message]).toEqual([413, "Too large", "Send less."]);
  });

  it("says what it has against the photos, not that a parameter is wrong", async () => {
    const errors = [{ field: "photo", place: "form", detail: "At most 8." }];
    answer(JSON.stringify({ title: "A parameter is wrong", detail: "photo: At most 8.", errors }), 422);
    const refusal = await refusalOf();
    expect([refusal.title, refusal.message]).toEqual(["These photos cannot be taken", "At most 8."]);
  });

  it("may stand behind a proxy that knows no problem documents", async () => {
    answer("<html>Bad gateway</html>", 502);
    expect((await refusalOf()).title).toBe("The service answered 502");
  });

  it("may not be there", async () => {
    vi.stubGlobal("fetch", vi.fn().mockRejectedValue(new TypeError("Failed to fetch")));
    expect((await refusalOf()).title).toBe("The service did not answer");
  });
});

describe("what the service says of itself", () => {
  it("is asked for until it is told, and then no more", async () => {
    vi.stubGlobal("fetch", vi.fn().mockRejectedValue(new TypeError("Failed to fetch")));
    expect(await described()).toBeUndefined();
    answer(JSON.stringify({ accuracy: {}, matching: true }), 200);
    expect((await described())?.matching).toBe(true);
    expect((await described())?.matching).toBe(true);
    expect(vi.mocked(fetch)).toHaveBeenCalledTimes(1);
  });
});

describe("an example", () => {
  it("is refused as an own photo is where the service is not there, and is no photo where it has none", async () => {
    vi.stubGlobal("fetch", vi.fn().mockRejectedValue(new TypeError("Failed to fetch")));
    await expect(exampleFile("assets/a.jpg", new AbortController().signal)).rejects.toMatchObject({
      status: 0,
      title: "The service did not answer",
    });
    answer("<html>Gone</html>", 404);
    await expect(exampleFile("assets/a.jpg", new AbortController().signal)).rejects.toMatchObject({
      title: "The service answered 404",
    });
    answer("photo", 200);
    expect(await (await exampleFile("assets/a.jpg", new AbortController().signal)).text()).toBe("photo");
  });
});

describe("a key", () => {
  it("is kept where a request can carry it, and never otherwise", () => {
    expect([keepKey("schlüssel"), apiKey()]).toEqual([true, "schlüssel"]);
    expect([keepKey("key“€”"), keepKey("a\nb"), apiKey()]).toEqual([false, false, "schlüssel"]);
  });
});

describe("latest", () => {
  it("does only the last of many calls", async () => {
    vi.useFakeTimers();
    const done: number[] = [];
    const call = latest<number>(
      async (value) => void done.push(value),
      40,
      (error) => expect.fail(String(error)),
    );
    for (const value of [1, 2, 3]) call(value);
    await vi.advanceTimersByTimeAsync(100);
    expect(done).toEqual([3]);
  });

  it("aborts the call under way, and that is no failure", async () => {
    vi.useFakeTimers();
    const [signals, failed]: [AbortSignal[], unknown[]] = [[], []];
    const wait = (_: number, signal: AbortSignal): Promise<void> =>
      new Promise((_resolve, reject) => {
        signals.push(signal);
        signal.addEventListener("abort", () => reject(signal.reason));
      });
    const call = latest<number>(wait, 10, (error) => failed.push(error));
    call(1);
    await vi.advanceTimersByTimeAsync(20);
    call(2);
    await vi.advanceTimersByTimeAsync(20);
    expect(signals.map(({ aborted }) => aborted)).toEqual([true, false]);
    expect(failed).toEqual([]);
  });

  it("hands on what goes wrong", async () => {
    vi.useFakeTimers();
    const failed: unknown[] = [];
    const call = latest<number>(
      async () => Promise.reject(new Error("broken")),
      0,
      (error) => failed.push(error),
    );
    call(1);
    await vi.advanceTimersByTimeAsync(5);
    expect(failed).toEqual([new Error("broken")]);
  });
});
