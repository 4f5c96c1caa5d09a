"""Every setting of the service; each is read from an environment variable LIGHTING_<NAME>."""

import os
import re
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from functools import lru_cache
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from pathlib import Path
from typing import Annotated, Any, Literal

from limits import RateLimitItem, parse_many
from pydantic import AfterValidator, BeforeValidator, DirectoryPath, Field, FilePath, PlainValidator, SecretStr
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from lighting.errors import LightingError
from lighting.photo import sandbox as decoding
from lighting.photo.reader import MAX_BYTES, MAX_PIXELS, PILLOW_MAX_PIXELS
from lighting.registration import photo_set as matching
from lighting.runtime import available_cpus

PREFIX = "LIGHTING_"

_DAY_SECONDS = 86_400.0  # the longest time limit; timers do not accept infinity
_UNSENDABLE = "holds a character outside ASCII or a control character, which no client could send"


class SettingsError(LightingError):
    """A setting that is invalid."""


def _find_unsendable(keys: Iterable[str]) -> int | None:
    """The number, from 1, of the first key that no Authorization header can carry."""
    return next((n for n, key in enumerate(keys, 1) if not all(" " <= letter <= "~" for letter in key)), None)


def _split_words(value: object) -> object:
    """Split a text at commas and white space."""
    return tuple(value.replace(",", " ").split()) if isinstance(value, str) else value


def _split_keys(value: object) -> object:
    """Split a text of keys; ValueError if it holds none, which would leave the service open."""
    words = _split_words(value)
    if value and not words:
        raise ValueError("It holds no key; leave it unset to let everybody call.")
    return words


def _to_lowercase(value: object) -> object:
    """A text in lower case."""
    return value.lower() if isinstance(value, str) else value


def _check_keys(keys: tuple[SecretStr, ...]) -> tuple[SecretStr, ...]:
    if number := _find_unsendable(key.get_secret_value() for key in keys):
        raise ValueError(f"Key {number} {_UNSENDABLE}.")
    return keys


def _parse_limits(text: str) -> tuple[RateLimitItem, ...]:
    try:
        limits = tuple(parse_many(text)) if text else ()
    except ValueError as error:
        raise ValueError(f"{text} is not a rate limit such as 60/minute or 5/second;1000/day.") from error
    if any(limit.amount < 1 for limit in limits):
        raise ValueError(f"{text} lets nobody call; a limit allows at least 1.")
    return limits


def _check_networks(text: str) -> str:
    list(_parse_networks(text))
    return text


def _like(pattern: str, example: str) -> AfterValidator:
    """A check that a pattern matches a text, or each of several."""

    def check(value: Any) -> Any:
        for text in (value,) if isinstance(value, str) else value:
            if not re.fullmatch(pattern, text):
                raise ValueError(f"{text} is not {example}.")
        return value

    return AfterValidator(check)


# The last of those before comes first.
_Words = Annotated[tuple[str, ...], NoDecode, BeforeValidator(_split_words), BeforeValidator(_to_lowercase)]
Origins = Annotated[  # as browsers send them
    _Words,
    _like(r"\*|[a-z][a-z0-9+.-]*://[^/?#\s;'\"]+", "an origin such as https://example.org, without a slash at its end"),
]
Names = Annotated[
    _Words,
    _like(r"[a-z0-9_-]+(\.[a-z0-9_-]+)*", "a name such as light.example.org, without scheme and port"),
]
SecretKeys = Annotated[tuple[SecretStr, ...], NoDecode, BeforeValidator(_split_keys), AfterValidator(_check_keys)]
Limits = Annotated[tuple[RateLimitItem, ...], NoDecode, PlainValidator(_parse_limits)]
RootPath = Annotated[str, _like(r"(/[A-Za-z0-9_.~-]+)*", "a path such as /light, without a slash at its end")]
CollectorUrl = Annotated[str, _like(r"(https?://[^/?#\s]+(/[^?#\s]*)?)?", "a URL such as http://collector:4318")]
Seconds = Annotated[float, Field(gt=0, le=_DAY_SECONDS)]
Level = Annotated[Literal["debug", "info", "warning", "error"], BeforeValidator(_to_lowercase)]


class Settings(BaseSettings):
    """The operator's settings."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, env_ignore_empty=True, extra="forbid")

    host: str = Field("127.0.0.1", description="address to listen on; `0.0.0.0` listens on all")
    port: int = Field(8000, ge=0, le=65535, description="port to listen on; 0 picks a free one")
    model: Path | None = Field(None, description="path of another network (.onnx) than the one in the package")
    photo: FilePath | None = Field(
        None, description="photo that the page shows at `/#opened/SECRET/NAME`, as `lighting open` asks"
    )
    photo_secret: SecretStr | None = Field(
        None, description="the SECRET in that address; without it, nobody gets the photo"
    )
    concurrency: int = Field(
        0,
        ge=0,
        le=1024,
        description="requests processed at the same time, and a short one beside long ones; 0 means one per CPU",
    )
    threads: int = Field(1, ge=1, le=1024, description="onnxruntime threads per photo")
    queue: int = Field(32, ge=0, description="requests that may wait; beyond these, one of each client")
    max_bytes: int = Field(MAX_BYTES, ge=1, description="maximum size of a request body in bytes")
    max_pixels: int = Field(
        MAX_PIXELS,
        ge=1,
        le=PILLOW_MAX_PIXELS,
        description="maximum number of pixels of a photo, checked before it is decoded",
    )
    max_photos: int = Field(8, ge=1, le=64, description="maximum number of photos in one request")
    uploads: int = Field(32, ge=1, description="bodies that may arrive at a time; the slowest gives way")
    uploads_per_client: int = Field(8, ge=1, description="the same for one client; 429 for further ones")
    connections: int = Field(1000, ge=8, description="connections that may be open at a time; silent ones give way")
    connections_per_client: int = Field(100, ge=1, description="the same for one client's address")
    upload_seconds: Seconds = Field(60.0, description="time limit for receiving a body, in seconds")
    upload_rate: int = Field(
        10_000, ge=1, description="least speed of a body in bytes per second, after its first five seconds"
    )
    answer_rate: int = Field(
        50_000, ge=1, description="least speed at which an answer is taken in bytes per second, after thirty seconds"
    )
    unsent_bytes: int = Field(
        500_000_000, ge=1, description="bytes of answers that may wait for their clients; the slowest gives way"
    )
    header_seconds: Seconds = Field(10.0, description="time limit for receiving a request's headers, in seconds")
    decode_seconds: Seconds = Field(
        decoding.MAX_DECODE_SECONDS, description="time limit for decoding a request's photos, in seconds"
    )
    match_seconds: Seconds = Field(
        matching.MATCHING_SECONDS, description="time limit for matching a request's photos with each other, in seconds"
    )
    shutdown_seconds: int = Field(
        30,
        ge=1,
        le=_DAY_SECONDS,
        description="time that running requests have after SIGTERM, SIGINT or SIGHUP, in seconds",
    )
    cache_seconds: int = Field(86400, ge=0, description="`max-age` of rendered maps and scenes, in seconds")
    api_keys: SecretKeys = Field(
        (),
        description="API keys (`Authorization: Bearer KEY`) between commas or spaces; without keys everybody may call",
    )
    api_keys_file: Path | None = Field(None, description="file with further keys, one per line; `#` begins a comment")
    rate_limit: Limits = Field((), description="rate limit per client, for example `60/minute` or `5/second;1000/day`")
    cpu_limit: Limits = Field((), description="limit per client in seconds of processor time, for example `20/minute`")
    jobs_folder: DirectoryPath | None = Field(
        None, description="folder of long jobs, their uploads and results; without one there are no jobs"
    )
    jobs: int = Field(16, ge=1, le=10_000, description="jobs that are kept at a time; one client has a quarter of them")
    job_bytes: int = Field(500_000_000, ge=1, description="bytes of disk for one job; its upload may have half of them")
    job_seconds: Seconds = Field(3600.0, description="time limit for one job's work, in seconds")
    hosts: Names = Field(
        (), description="names of the service, separated by commas or spaces; requests for another name are refused"
    )
    cors_origins: Origins = Field((), description="origins whose web pages may call, separated by commas or spaces")
    frame_origins: Origins = Field(
        (),
        description="origins whose pages may show the page in a frame, separated by commas or spaces, for example "
        "`https://huggingface.co`",
    )
    trusted_proxies: Annotated[str, AfterValidator(_check_networks)] = Field(
        "", description="addresses whose `X-Forwarded-For` header is trusted, separated by commas; without any, none is"
    )
    root_path: RootPath = Field(
        "", description="path that a proxy removes from requests, for example `/light`; `/openapi.json` names it"
    )
    otlp_endpoint: CollectorUrl = Field(
        "",
        description="URL of an OpenTelemetry collector that gets traces by OTLP over HTTP, for example "
        "`http://collector:4318`; needs the extra `all`",
    )
    log_level: Level = Field("info", description="lowest level that is logged: debug, info, warning or error")

    @property
    def opened_photo(self) -> tuple[Path, str] | None:
        """The photo that the page shows, and the secret for which it is given; None where one of them is missing."""
        secret = self.photo_secret.get_secret_value() if self.photo_secret else ""
        return (self.photo, secret) if self.photo and secret else None

    @property
    def workers(self) -> int:
        """Requests processed at the same time."""
        return self.concurrency or available_cpus()

    def is_trusted_proxy(self, host: str) -> bool:
        """Whether an address is one of `trusted_proxies`.

        Args:
            host: the address of a connection.
        """
        return bool(self.trusted_proxies) and _is_in_networks(host, self.trusted_proxies)

    def all_keys(self) -> tuple[str, ...]:
        """The keys of the environment and of the file; raises SettingsError for a file without keys."""
        in_file = _read_key_file(self.api_keys_file) if self.api_keys_file else []
        return (*(key.get_secret_value() for key in self.api_keys), *in_file)


def _parse_networks(text: str) -> Iterator[IPv4Network | IPv6Network]:
    """The networks between commas, of which `*` is all; ValueError for other words."""
    for word in filter(None, map(str.strip, text.split(","))):
        try:
            yield from map(ip_network, ("0.0.0.0/0", "::/0") if word == "*" else (word,))
        except ValueError as error:
            raise ValueError(f"{word} is not an IP address or network; names are not looked up.") from error


@lru_cache(maxsize=4096)
def _is_in_networks(host: str, text: str) -> bool:
    """Whether an address is in one of the networks between commas."""
    address = parse_address(host)
    return address is not None and any(address in network for network in _parse_networks(text))


def parse_address(host: str) -> IPv4Address | IPv6Address | None:
    """The address in a text, of IPv4 also where IPv6 maps it; None where there is none.

    Args:
        host: of a connection or a header, without a port.
    """
    try:
        address = ip_address(host)
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def read_settings() -> Settings:
    """The settings of the environment.

    Raises:
        SettingsError: a variable LIGHTING_... is no setting; misspelt, it would leave a limit or keys unset.
        ValidationError: a value is invalid.
    """
    names = [name.upper() for name in Settings.model_fields]
    for variable, value in os.environ.items():
        setting = variable.upper().removeprefix(PREFIX)
        if value and variable.upper() != setting and setting not in names:
            near = get_close_matches(setting, names, n=1)
            hint = f"did you mean {PREFIX}{near[0]}?" if near else "unset it."
            raise SettingsError(f"{variable} is no setting; {hint}")
    return Settings()


def _read_key_file(path: Path) -> list[str]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise SettingsError(f"{PREFIX}API_KEYS_FILE: {path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise SettingsError(f"{PREFIX}API_KEYS_FILE: {path} is not a text file.") from error
    keys = [key for line in lines if (key := line.partition("#")[0].strip())]
    if number := _find_unsendable(keys):
        raise SettingsError(f"{PREFIX}API_KEYS_FILE: key {number} of {path} {_UNSENDABLE}.")
    if not keys:
        raise SettingsError(f"{PREFIX}API_KEYS_FILE: {path} holds no key; leave it unset to let everybody call.")
    return keys
