"""Every setting of the service; each is read from an environment variable LIGHTING_<NAME>."""

from pathlib import Path
from typing import Annotated, Literal

from limits import RateLimitItem, parse_many
from pydantic import BeforeValidator, Field, SecretStr, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from lighting.errors import LightingError
from lighting.model import available_cpus
from lighting.photo import MAX_BYTES, MAX_PIXELS, MOST_PIXELS

PREFIX = "LIGHTING_"


class SettingsError(LightingError):
    """A setting that cannot be followed."""


def _words(value: object) -> object:
    """The words of a text, between commas or white space."""
    return tuple(value.replace(",", " ").split()) if isinstance(value, str) else value


def _keys(value: object) -> object:
    """The same of keys; ValueError for a text without any, which would leave the service open."""
    words = _words(value)
    if value and not words:
        raise ValueError("There is no key in it; leave it out to let everybody call.")
    return words


Words = Annotated[tuple[str, ...], NoDecode, BeforeValidator(_words)]
Keys = Annotated[tuple[SecretStr, ...], NoDecode, BeforeValidator(_keys)]


class Settings(BaseSettings):
    """What an operator may choose."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, env_ignore_empty=True, extra="forbid")

    host: str = Field("127.0.0.1", description="address to listen on; `0.0.0.0` is every one")
    port: int = Field(8000, ge=0, le=65535, description="port to listen on; 0 takes a free one")
    model: Path | None = Field(None, description="another network (.onnx) than the one in the package")
    concurrency: int = Field(0, ge=0, le=1024, description="requests worked on at once; 0 is one per CPU")
    threads: int = Field(1, ge=1, le=1024, description="threads of onnxruntime for one photo")
    queue: int = Field(64, ge=0, description="requests that may wait beside those; the next is answered 503")
    max_bytes: int = Field(MAX_BYTES, ge=1, description="largest body")
    max_pixels: int = Field(
        MAX_PIXELS, ge=1, le=MOST_PIXELS, description="most pixels of a photo, looked at before it is decoded"
    )
    max_photos: int = Field(8, ge=1, le=64, description="most photos of one place in one request")
    upload_seconds: float = Field(60.0, gt=0, description="longest time a body may take to arrive")
    shutdown_seconds: int = Field(30, ge=1, description="time that running requests have after SIGTERM")
    cache_seconds: int = Field(86400, ge=0, description="`max-age` of rendered maps")
    api_keys: Keys = Field((), description="keys (`Authorization: Bearer KEY`) between commas; none leaves all open")
    api_keys_file: Path | None = Field(None, description="file with more keys, one a line, `#` begins a comment")
    rate_limit: str = Field("", description="requests per client, such as `60/minute` or `5/second;1000/day`")
    cors_origins: Words = Field((), description="origins of pages elsewhere that may call, separated by commas")
    trusted_proxies: str = Field("127.0.0.1", description="addresses whose `X-Forwarded-For` is believed")
    log_level: Literal["debug", "info", "warning", "error"] = Field("info", description="least level that is logged")

    @field_validator("rate_limit")
    @classmethod
    def _limit_can_be_read(cls, text: str) -> str:
        if text:
            parse_many(text)
        return text

    @property
    def places(self) -> int:
        """Requests worked on at once."""
        return self.concurrency or available_cpus()

    @property
    def rate_limits(self) -> list[RateLimitItem]:
        return parse_many(self.rate_limit) if self.rate_limit else []

    def all_keys(self) -> tuple[str, ...]:
        """The keys of the environment and of the file; SettingsError where the file holds none."""
        in_file = _keys_in(self.api_keys_file) if self.api_keys_file else []
        return (*(key.get_secret_value() for key in self.api_keys), *in_file)


def _keys_in(path: Path) -> list[str]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise SettingsError(f"{PREFIX}API_KEYS_FILE: {path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise SettingsError(f"{PREFIX}API_KEYS_FILE: {path} is not a text file.") from error
    keys = [key for line in lines if (key := line.partition("#")[0].strip())]
    if not keys:
        raise SettingsError(f"{PREFIX}API_KEYS_FILE: {path} holds no key; leave it out to let everybody call.")
    return keys
