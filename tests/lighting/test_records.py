"""Tests of records."""

import json
import math
import pickle
from copy import deepcopy
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.errors import CodedWarning, ParameterError, WarningCode, warning_code
from lighting.fields import OPTIONAL_RANGES, RANGES, clip_color
from lighting.geometry import direction
from lighting.records import EvidenceKind, Lighting, SunCandidate, describe_candidates, describe_trust

LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.02, ground_albedo=0.2)


LIGHTING = Lighting(
    sun_azimuth=-41.2,
    sun_elevation=33.0,
    turbidity=3.4,
    exposure=0.021,
    ground_albedo=0.25,
    sun_visibility=0.93,
    radius_50=9.5,
    radius_90=31.0,
    camera_elevation=4.1,
    camera_roll=-0.6,
    vertical_fov=48.7,
    model_name="outdoor",
    model_version="1.0.0",
)


PLACES = {  # of each field in the JSON record
    "sun_azimuth": ("sun", "azimuth"),
    "sun_elevation": ("sun", "elevation"),
    "sun_visibility": ("sun", "visibility"),
    "radius_50": ("sun", "radius_50"),
    "radius_90": ("sun", "radius_90"),
    "turbidity": ("sky", "turbidity"),
    "ground_albedo": ("sky", "ground_albedo"),
    "exposure": ("sky", "exposure"),
    "camera_elevation": ("camera", "elevation"),
    "camera_roll": ("camera", "roll"),
    "vertical_fov": ("camera", "vertical_fov"),
    "camera_height": ("camera", "height"),
}


WRONG = [None, "3", True, [3.0], {"value": 3.0}, math.nan, math.inf, -math.inf, 10**4000, np.bool_(True), np.str_("3")]


def in_json(name: str) -> str:
    return ".".join(PLACES[name])


def record_with(name: str, value: object) -> dict[str, Any]:
    record = deepcopy(LIGHTING.to_dict())
    section, key = PLACES[name]
    record[section][key] = value
    return record


def changed(name: str, value: object) -> Lighting:
    fields: dict[str, Any] = {name: value}
    return replace(LIGHTING, **fields)


def sentence(error: BaseException) -> str:
    text = str(error)
    assert text.endswith(".")
    assert "\n" not in text
    assert len(text) < 200
    return text


def test_the_record_survives_json() -> None:
    text = json.dumps(LIGHTING.to_dict(), allow_nan=False)
    assert Lighting.from_dict(json.loads(text)) == LIGHTING


def test_the_record_has_the_documented_shape() -> None:
    record = LIGHTING.to_dict()
    assert set(record) == {"model", "sun", "sky", "camera", "trust", "evidence", "warnings"}
    assert record["model"] == {"name": "outdoor", "version": "1.0.0"}
    assert record["sun"]["direction"] == pytest.approx(direction(-41.2, 33.0), abs=1e-6)
    assert record["sky"]["model"] == "hosek-wilkie"
    for name, (section, key) in PLACES.items():
        assert record[section][key] == getattr(LIGHTING, name)


@given(st.fixed_dictionaries({name: st.floats(low, high) for name, (low, high) in RANGES.items()}))
def test_every_record_in_range_survives_json(values: dict[str, Any]) -> None:
    lighting = Lighting(**values)
    assert Lighting.from_dict(json.loads(json.dumps(lighting.to_dict(), allow_nan=False))) == lighting


def test_only_the_sun_and_the_sky_are_needed() -> None:
    record = {"sun": {"azimuth": 10, "elevation": 20}, "sky": {"turbidity": 3, "exposure": 0.1}}
    assert Lighting.from_dict(record) == Lighting(10.0, 20.0, 3.0, 0.1)


def test_the_time_of_a_photo_is_kept_with_its_offset_and_its_source() -> None:
    moment = datetime(2024, 6, 1, 18, 49, tzinfo=timezone(timedelta(hours=2)))
    light = replace(LIGHTING, utc_time=moment, utc_offset=2.0, time_source="GPS")
    record = light.to_dict()
    assert record["time"] == {"utc": "2024-06-01T16:49:00Z", "utc_offset": 2.0, "source": "GPS"}
    assert Lighting.from_dict(record) == light
    assert "time" not in LIGHTING.to_dict()


@pytest.mark.parametrize(
    ("time", "field"),
    [
        ({"utc": "2024-06-01T16:49:00"}, "time.utc"),
        ({"utc": "noon"}, "time.utc"),
        ({"utc": 5}, "time.utc"),
        ({"utc_offset": 15.0}, "time.utc_offset"),
        ({"source": 5}, "time.source"),
    ],
)
def test_a_wrong_time_is_named(time: dict[str, Any], field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict(LIGHTING.to_dict() | {"time": time})
    assert caught.value.field == field


def test_derived_values_are_recomputed_rather_than_believed() -> None:
    record = LIGHTING.to_dict()
    record["sun"]["direction"] = "nonsense"
    record["sky"]["coefficients"] = None
    assert Lighting.from_dict(record) == LIGHTING


@pytest.mark.parametrize("name", RANGES)
def test_values_outside_a_range_are_named(name: str) -> None:
    low, high = RANGES[name]
    for value in (low - 1e-3 * (abs(low) + 1e-3), high * 1.001):
        with pytest.raises(ParameterError) as caught:
            changed(name, value)
        assert sentence(caught.value).startswith(f"{name} is ")
        with pytest.raises(ParameterError, match=f"^{in_json(name)} is "):
            Lighting.from_dict(record_with(name, value))
    for value in (low, high):
        assert getattr(changed(name, value), name) == value


@pytest.mark.parametrize("value", WRONG[1:], ids=lambda v: repr(v)[:12])
@pytest.mark.parametrize("name", RANGES)
def test_values_of_the_wrong_type_are_named(name: str, value: object) -> None:
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict(record_with(name, value))
    assert sentence(caught.value).startswith(f"{in_json(name)} must be a finite number")


@pytest.mark.parametrize("name", ["sun_azimuth", "sun_elevation", "turbidity", "exposure"])
def test_a_missing_value_is_named(name: str) -> None:
    record = LIGHTING.to_dict()
    section, key = PLACES[name]
    del record[section][key]
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict(record)
    assert sentence(caught.value) == f"The lighting record lacks {in_json(name)}."


@pytest.mark.parametrize("name", ["ground_albedo", "vertical_fov", "sun_visibility"])
def test_null_means_the_default(name: str) -> None:
    default = Lighting(0.0, 0.0, 2.0, 1.0)
    assert getattr(Lighting.from_dict(record_with(name, None)), name) == getattr(default, name)


@pytest.mark.parametrize("record", [None, 3, "text", [], [1, 2]], ids=repr)
def test_what_is_no_object_is_refused(record: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict(record)
    assert sentence(caught.value) == f"A lighting record must be an object, not {record!r}."


@pytest.mark.parametrize("record", [{}, {"sun": 1}, {"sun": []}], ids=repr)
def test_what_is_no_record_is_refused(record: Any) -> None:
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict(record)
    assert sentence(caught.value) == "The lighting record needs an object 'sun'."


@pytest.mark.parametrize("name", ["sun", "sky", "camera", "model"])
@pytest.mark.parametrize("value", [3, "text", [1.0]], ids=repr)
def test_a_section_that_is_no_object_is_refused(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=f"'{name}'"):
        Lighting.from_dict({**LIGHTING.to_dict(), name: value})


@pytest.mark.parametrize("model", ["hosek", 5, ["hosek-wilkie"], "x" * 10_000], ids=lambda v: repr(v)[:12])
def test_another_sky_model_is_refused(model: object) -> None:
    record = LIGHTING.to_dict()
    record["sky"]["model"] = model
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict(record)
    del record["sky"]["model"]
    with pytest.raises(ParameterError, match=r"^sky\.painted is "):
        Lighting.from_dict({**record, "sky": {**record["sky"], "painted": model}})
    assert "the known ones are hosek-wilkie, prague, preetham" in sentence(caught.value)


@pytest.mark.parametrize(
    ("section", "name", "value", "said"),
    [
        ("camera", "heading", 400.0, "camera.heading is 400;"),
        ("camera", "heading_probability", [0.5], "camera.heading_probability has 1 values;"),
        ("ground", "color", [1, 2], "ground.color must be three numbers"),
        ("ground", "color", [0, 0, 2], "ground.color is 2;"),
    ],
)
def test_an_error_names_the_field_as_the_record_does(section: str, name: str, value: object, said: str) -> None:
    record = LIGHTING.to_dict()
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict({**record, section: {**record.get(section, {}), name: value}})
    assert sentence(caught.value).startswith(said)


def test_a_model_without_a_name_is_none() -> None:
    read = Lighting.from_dict({**LIGHTING.to_dict(), "model": {"name": None, "version": None}})
    assert (read.model_name, read.model_version) == ("none", "0")


def test_a_model_name_must_be_text() -> None:
    with pytest.raises(ParameterError, match=r"^model\.name must be a text"):
        Lighting.from_dict({**LIGHTING.to_dict(), "model": {"name": {"deep": 1}}})


@pytest.mark.parametrize("name", ["evidence", "warnings"])
@pytest.mark.parametrize("value", ["pixels", 3, [3], None])
def test_lists_of_texts_are_checked_and_kept_as_tuples(name: str, value: Any) -> None:
    right: dict[str, Any] = {name: ["pixels"]}
    wrong: dict[str, Any] = {name: value}
    assert getattr(Lighting(0.0, 0.0, 2.0, 1.0, **right), name) == ("pixels",)
    with pytest.raises(ParameterError, match=f"^{name} must be a list of texts, not "):
        Lighting(0.0, 0.0, 2.0, 1.0, **wrong)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["azimuth", "elevation", "x"]), inner),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from(["sun", "sky", "camera", "model"]), json_values))
def test_any_json_is_a_record_or_a_parameter_error(record: dict[str, Any]) -> None:
    try:
        assert isinstance(Lighting.from_dict(record), Lighting)
    except ParameterError as error:
        sentence(error)


KNOWING = replace(
    LIGHTING,
    evidence=("pixels", "time+place"),
    warnings=("The pixels say otherwise.",),
    camera_heading=123.0,
    camera_heading_radius_50=7.5,
    camera_heading_radius_90=20.0,
    camera_heading_probability=tuple(1 / 360 for _ in range(360)),
    relative_heading=45.0,
    latitude=48.1,
    longitude=-11.6,
)


def test_a_record_keeps_what_is_known() -> None:
    record = json.loads(json.dumps(KNOWING.to_dict(), allow_nan=False))
    assert Lighting.from_dict(record) == KNOWING
    assert record["evidence"] == ["pixels", "time+place"]
    assert record["warnings"] == ["The pixels say otherwise."]
    assert record["camera"]["heading"] == 123.0
    assert len(record["camera"]["heading_probability"]) == 360
    assert record["camera"]["relative_heading"] == 45.0
    assert record["place"] == {"latitude": 48.1, "longitude": -11.6}


def test_a_record_leaves_out_what_is_unknown() -> None:
    record = LIGHTING.to_dict()
    assert set(record["camera"]) == {"elevation", "roll", "vertical_fov", "height"}
    assert (record["evidence"], record["warnings"]) == ([], [])


def test_a_record_of_the_first_version_is_still_read() -> None:
    record = {key: value for key, value in LIGHTING.to_dict().items() if key not in ("evidence", "warnings")}
    assert Lighting.from_dict(record) == LIGHTING
    assert Lighting.from_dict({**record, "evidence": None, "warnings": None, "place": None}) == LIGHTING


@pytest.mark.parametrize("name", OPTIONAL_RANGES)
def test_what_is_known_is_checked_too(name: str) -> None:
    low, high = OPTIONAL_RANGES[name]
    assert changed(name, None) == LIGHTING
    for value in (low - 0.01, high + 0.01, math.nan, "3"):
        with pytest.raises(ParameterError, match=name):
            changed(name, value)


@pytest.mark.parametrize("value", [[0.5], [0.5] * 359 + [2.0], [0.5] * 359 + ["x"], 3.0, "text"])
def test_headings_are_360_probabilities(value: object) -> None:
    record = deepcopy(KNOWING.to_dict())
    record["camera"]["heading_probability"] = value
    with pytest.raises(ParameterError, match="heading_probability"):
        Lighting.from_dict(record)


@pytest.mark.parametrize("name", ["evidence", "warnings"])
@pytest.mark.parametrize("value", ["pixels", [3], {"a": 1}, 7])
def test_evidence_and_warnings_are_texts(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=name):
        Lighting.from_dict({**LIGHTING.to_dict(), name: value})


@pytest.mark.parametrize("word", ["", "Pixels", "astrology", "time"])
def test_evidence_is_of_known_kinds(word: str) -> None:
    with pytest.raises(ParameterError, match=r"^evidence has an unknown word .*'time\+place'.*\.$") as caught:
        Lighting.from_dict({**LIGHTING.to_dict(), "evidence": ["pixels", word]})
    assert (caught.value.field, caught.value.code) == ("evidence", "unknown")
    every = list(map(str, EvidenceKind))
    assert Lighting.from_dict({**LIGHTING.to_dict(), "evidence": every}).evidence == tuple(every)


@pytest.mark.parametrize("path", ["sun.irradiance", "sky.irradiance", "ground.color"])
def test_an_empty_list_is_no_absent_colour(path: str) -> None:
    section, name = path.split(".")
    record = deepcopy(STRONG.to_dict())
    record[section][name] = []
    with pytest.raises(ParameterError, match="must be three numbers: red, green and blue"):
        Lighting.from_dict(record)
    record = deepcopy(LIGHTING.to_dict())
    record["sun"]["irradiance"] = record["sky"]["irradiance"] = []
    with pytest.raises(ParameterError, match="must be three numbers"):
        Lighting.from_dict(record)


def test_what_paints_the_sky_stands_beside_its_model() -> None:
    """Records without `sky.painted` keep their maps; a `sky.model` that is set by hand counts."""
    painted = replace(LIGHTING, sky_painted="prague")
    record = painted.to_dict()
    assert (record["sky"]["model"], record["sky"]["painted"]) == ("hosek-wilkie", "prague")
    assert Lighting.from_dict(json.loads(json.dumps(record))) == painted
    assert "painted" not in LIGHTING.to_dict()["sky"]
    assert (painted.map_sky, LIGHTING.map_sky) == ("prague", "hosek-wilkie")
    assert replace(painted, sky_model="perez").map_sky == "perez"


STRONG = replace(
    LIGHTING,
    sky_model="perez",
    sun_irradiance=(1.9, 1.5, 0.9),
    sky_irradiance=(0.4, 0.5, 0.8),
    sky_cover=0.2,
    ground_color=(0.12, 0.11, 0.1),
    suitable=0.97,
)


ON_GROUND = replace(LIGHTING, ground_visible=0.4, spot_pixel=(12.5, 80.0), spot_direction=(0.6, -0.8, 0.0))


def test_the_spot_survives_json() -> None:
    record = json.loads(json.dumps(ON_GROUND.to_dict()))
    assert record["ground"] == {"visible": 0.4, "spot": {"pixel": [12.5, 80.0], "direction": [0.6, -0.8, 0.0]}}
    assert Lighting.from_dict(record) == ON_GROUND
    without = replace(LIGHTING, ground_visible=0.0)
    assert without.to_dict()["ground"] == {"visible": 0.0, "spot": None}
    assert Lighting.from_dict(without.to_dict()) == without


@pytest.mark.parametrize(
    "spot",
    [
        {"pixel": [1.0, 2.0]},
        {"direction": [0.0, -1.0, 0.0]},
        {"pixel": [1.0], "direction": [0.0, -1.0, 0.0]},
        {"pixel": [1.0, math.nan], "direction": [0.0, -1.0, 0.0]},
        {"pixel": [1.0, 2.0], "direction": [0.0, -0.5, 0.0]},
        {"pixel": [1.0, 2.0], "direction": [0.0, 0.6, -0.8]},
        {"pixel": "here", "direction": [0.0, -1.0, 0.0]},
        7,
    ],
)
def test_a_spot_is_a_pixel_and_a_unit_vector(spot: object) -> None:
    with pytest.raises(ParameterError, match="spot"):
        Lighting.from_dict({**LIGHTING.to_dict(), "ground": {"spot": spot}})


def test_the_strength_of_the_light_survives_json() -> None:
    record = STRONG.to_dict()
    assert Lighting.from_dict(json.loads(json.dumps(record))) == STRONG
    assert record["sun"]["irradiance"] == [1.9, 1.5, 0.9]
    assert (record["sky"]["irradiance"], record["sky"]["cover"]) == ([0.4, 0.5, 0.8], 0.2)
    assert (record["ground"], record["suitable"]) == ({"color": [0.12, 0.11, 0.1]}, 0.97)
    assert not {"ground", "suitable"} & set(LIGHTING.to_dict())


@pytest.mark.parametrize(
    ("section", "name", "value"),
    [
        ("sun", "irradiance", [1.0, 2.0]),
        ("sky", "irradiance", [1.0, -2.0, 1.0]),
        ("ground", "color", [0.1, 0.1, 1.1]),
        ("ground", "color", "grey"),
        ("sun", "irradiance", None),
    ],
)
def test_a_colour_is_three_numbers_in_range_and_irradiances_go_together(section: str, name: str, value: object) -> None:
    record = STRONG.to_dict()
    record[section][name] = value
    with pytest.raises(ParameterError) as caught:
        Lighting.from_dict(record)
    assert sentence(caught.value)


def test_colours_are_clipped_and_have_six_digits() -> None:
    assert clip_color(np.array([-1.0, 0.12345678, 2.0]), "ground_color") == (0.0, 0.123457, 1.0)


def test_numbers_of_numpy_become_plain_ones() -> None:
    numbers: dict[str, Any] = {
        "sun_azimuth": np.float32(12.5),
        "turbidity": np.int64(3),
        "sun_irradiance": np.array([1.0, 2.0, 3.0], np.float32),
        "ground_color": [0.25, np.float32(0.5), 1],
        "latitude": np.float16(8),
        "longitude": 9,
        "exposure": np.array(0.5),
    }
    light = replace(STRONG, **numbers)
    assert (light.sun_azimuth, light.turbidity, light.latitude, light.exposure) == (12.5, 3, 8.0, 0.5)
    assert light.sun_irradiance == (1.0, 2.0, 3.0)
    assert light.ground_color == (0.25, 0.5, 1)
    assert Lighting.from_dict(json.loads(json.dumps(light.to_dict()))) == light
    with pytest.raises(ParameterError, match="turbidity must be a finite number, not nan"):
        changed("turbidity", np.float32("nan"))


@pytest.mark.parametrize("probability", [None, 0.5, np.array(0.5), "1"])
def test_the_headings_probabilities_are_a_list(probability: Any) -> None:
    with pytest.raises(ParameterError, match=r"^camera_heading_probability must be a list of numbers, not .*\.$"):
        changed("camera_heading_probability", probability)


def test_cover_needs_irradiances() -> None:
    with pytest.raises(ParameterError, match=r"^sky_cover needs"):
        replace(LIGHTING, sky_cover=0.5)


def test_a_coded_warning_is_a_text_like_any_other() -> None:
    coded = CodedWarning("It may be cropped.", WarningCode.LENS_CONTRADICTED)
    light = replace(
        LIGHTING, warnings=(coded, "Look out."), evidence=(EvidenceKind.PIXELS, EvidenceKind.TIME_AND_PLACE)
    )
    assert light.warnings == ("It may be cropped.", "Look out.")
    assert [warning_code(warning) for warning in light.warnings] == ["lens-contradicted", "other"]
    assert warning_code(pickle.loads(pickle.dumps(coded))) == "lens-contradicted"
    record = json.loads(json.dumps(light.to_dict()))
    assert (record["warnings"], record["evidence"]) == (["It may be cropped.", "Look out."], ["pixels", "time+place"])
    assert [type(kind) for kind in light.evidence] == [str, str]
    assert Lighting.from_dict(record) == light


CANDIDATES = (SunCandidate(-41.2, 33.0, 0.6), SunCandidate(120.0, 25.0, 0.31))


@pytest.mark.parametrize(
    ("visibility", "radius", "suitable", "trust"),
    [(0.5, 45.0, None, "sure"), (0.5, 45.1, 0.9, "unsure"), (0.49, 10.0, None, "no sun"), (1.0, 10.0, 0.4, "unsure")],
)
def test_trust_follows_from_visibility_radius_and_suitability(
    visibility: float, radius: float, suitable: float | None, trust: str
) -> None:
    light = Lighting(0.0, 30.0, 3.0, 4.0, sun_visibility=visibility, radius_90=radius, suitable=suitable)
    assert light.trust == trust
    assert light.to_dict()["trust"] == trust
    assert Lighting.from_dict({**light.to_dict(), "trust": "another word"}) == light
    assert describe_trust(light).startswith(trust)
    assert light.sun_painted == (trust != "no sun")


def test_an_unsure_answer_says_what_would_help() -> None:
    light = Lighting(0.0, 30.0, 3.0, 4.0, radius_90=80.0, sun_candidates=CANDIDATES)
    assert describe_trust(light) == "unsure: mark a shadow, give time and place or pick another sun"
    known = replace(light, evidence=("pixels", "time+place", "shadow"), sun_candidates=())
    assert describe_trust(known) == "unsure: set the sun by eye"
    assert describe_candidates(light) == "or 120° right (behind), 25° high (31 %)"
    assert describe_candidates(replace(light, radius_90=20.0)) == ""


def test_candidates_come_back_from_a_record() -> None:
    light = Lighting(-41.2, 33.0, 3.0, 4.0, sun_candidates=CANDIDATES)
    record = json.loads(json.dumps(light.to_dict()))
    assert record["sun"]["candidates"][1] == {"azimuth": 120.0, "elevation": 25.0, "probability": 0.31}
    assert Lighting.from_dict(record) == light


@pytest.mark.parametrize(
    "candidates", [3, [3], [{"azimuth": 1.0}], [{"azimuth": 900.0, "elevation": 1.0, "probability": 1.0}]]
)
def test_candidates_that_are_none_are_refused(candidates: object) -> None:
    record = Lighting(-41.2, 33.0, 3.0, 4.0).to_dict()
    record["sun"]["candidates"] = candidates
    with pytest.raises(ParameterError, match=r"^sun\.candidates "):
        Lighting.from_dict(record)
