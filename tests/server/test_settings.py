"""Settings: from the environment, checked, and in the documentation."""

import re
from pathlib import Path

import pytest
from pydantic import SecretStr, ValidationError

from server.app import create_app
from server.settings import PREFIX, Settings, SettingsError, read_settings


def test_every_setting_has_a_meaning() -> None:
    assert all(field.description for field in Settings.model_fields.values())


def test_settings_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {"HOST": "0.0.0.0", "PORT": "9000", "API_KEYS": "a,b c", "CORS_ORIGINS": "https://a https://b", "MODEL": ""}
    for name, value in given.items():
        monkeypatch.setenv(PREFIX + name, value)
    settings = Settings()
    assert (settings.host, settings.port, settings.model) == ("0.0.0.0", 9000, None)
    assert settings.all_keys() == ("a", "b", "c")
    assert settings.cors_origins == ("https://a", "https://b")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("LIGHTING_API_KEY", "LIGHTING_API_KEY is no setting; did you mean LIGHTING_API_KEYS?"),
        ("lighting_prot", "lighting_prot is no setting; did you mean LIGHTING_PORT?"),
        ("LIGHTING_X", "LIGHTING_X is no setting; unset it."),
    ],
)
def test_a_variable_that_is_no_setting_stops_the_start(monkeypatch: pytest.MonkeyPatch, name: str, words: str) -> None:
    monkeypatch.setenv(name, "")
    monkeypatch.setenv("LIGHTING_QUEUE", "7")
    assert read_settings().queue == 7
    monkeypatch.setenv(name, "1")
    for start in (read_settings, create_app):
        with pytest.raises(SettingsError, match=rf"^{re.escape(words)}$"):
            start()


def test_places_are_the_cpus_unless_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.settings.available_cpus", lambda: 7)
    assert Settings().workers == 7
    assert Settings(concurrency=3).workers == 3


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("PORT", "70000"),
        ("PORT", "http"),
        ("QUEUE", "-1"),
        ("RATE_LIMIT", "often"),
        ("LOG_LEVEL", "loud"),
        ("RATE_LIMIT", "5/second;0/day"),
        ("UPLOAD_SECONDS", "0"),
        ("UPLOAD_SECONDS", "inf"),
        ("HEADER_SECONDS", "inf"),
        ("DECODE_SECONDS", "inf"),
        ("MATCH_SECONDS", "1e12"),
        ("MAX_BYTES", "0"),
        ("SHUTDOWN_SECONDS", "100000000000000000000"),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(PREFIX + name, value)
    with pytest.raises(ValidationError) as caught:
        Settings()
    assert caught.value.errors()[0]["loc"] == (name.lower(),)


def test_a_level_of_the_log_may_be_in_capitals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PREFIX + "LOG_LEVEL", "WARNING")
    assert Settings().log_level == "warning"


def test_an_origin_may_be_written_in_capitals_which_browsers_do_not_send(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PREFIX + "CORS_ORIGINS", "https://Example.org, HTTP://localhost:3000")
    assert Settings().cors_origins == ("https://example.org", "http://localhost:3000")


@pytest.mark.parametrize("limit", ["60", "60/fortnight", "often", "5/second,"])
def test_a_rate_limit_that_cannot_be_read_is_told_with_an_example(limit: str) -> None:
    with pytest.raises(ValidationError, match=f"{limit} is not a rate limit such as 60/minute"):
        Settings(rate_limit=limit)


@pytest.mark.parametrize("origin", ["example.org", "https://example.org/", "https://a;b", "https://", "//a"])
def test_an_origin_that_no_browser_sends_is_refused(origin: str) -> None:
    for name in ("cors_origins", "frame_origins"):
        with pytest.raises(ValidationError, match="is not an origin"):
            Settings.model_validate({name: ("https://a", origin)})


@pytest.mark.parametrize("path", ["light", "/light/", "/", "//light", "https://example.org/light", "/a?b", "/a\n"])
def test_a_root_path_that_no_request_has_is_refused(path: str) -> None:
    with pytest.raises(ValidationError, match="is not a path such as /light"):
        Settings(root_path=path)


@pytest.mark.parametrize("trusted", ["", "*", "127.0.0.1", "10.0.0.0/8, ::1", "fd00::/8,"])
def test_proxies_are_addresses_or_networks(trusted: str) -> None:
    assert Settings(trusted_proxies=trusted).trusted_proxies == trusted


@pytest.mark.parametrize("trusted", ["proxy", "127.0.0.1, proxy", "10.0.0.1/8", "300.1.1.1"])
def test_other_proxies_would_never_be_met(trusted: str) -> None:
    with pytest.raises(ValidationError, match="is not an IP address or network"):
        Settings(trusted_proxies=trusted)


@pytest.mark.parametrize("key", ["tür", "ключ", "a\tb", "a\x7f"])
def test_a_key_that_no_client_could_send_is_refused_at_the_start(tmp_path: Path, key: str) -> None:
    with pytest.raises(ValidationError, match="Key 1 holds a character"):
        Settings(api_keys=(SecretStr(key),))
    (tmp_path / "keys").write_text(f"first\n{key}\n", encoding="utf-8")
    with pytest.raises(SettingsError, match=r"key 2 of .* holds a character"):
        Settings(api_keys_file=tmp_path / "keys").all_keys()


def test_the_mark_at_the_beginning_of_a_file_is_no_part_of_its_first_key(tmp_path: Path) -> None:
    (tmp_path / "keys").write_text("first\nsecond\n", encoding="utf-8-sig")
    assert Settings(api_keys_file=tmp_path / "keys").all_keys() == ("first", "second")
