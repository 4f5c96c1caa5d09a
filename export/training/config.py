"""The settings of a training run."""

from dataclasses import dataclass

from export.networks.outdoor import TARGET_WIDTH

PATH_SETTINGS = ("data", "labels", "start", "synthetic", "teachers")  # however the paths are written
MAY_CHANGE = ("out", "workers", "checkpoint_minutes")  # when a run is resumed: its folder may have moved


@dataclass(frozen=True)
class TrainConfig:
    """Everything a training run depends on besides the data; config.json has the same names."""

    data: str  # folder of panoramas
    labels: str  # CSV of `python -m export label`
    out: str  # folder for config.json, log.jsonl and checkpoint.pt
    network: str = "outdoor"  # or "cvpr2017"
    version: str = "1.0.0"
    crops: int = 100_000  # drawn in all
    batch: int = 32
    learning_rate: float = 8e-4
    weight_decay: float = 0.05
    warmup: float = 0.03  # share of the run
    ema: float = 0.998  # decay per step of the averaged weights, which are the result
    target_width: float = TARGET_WIDTH["outdoor"]  # deg per axis of the sun target, besides the label's uncertainty
    tune_share: float = 0.08  # of the training places, held out for the log
    aimed: float = 0.2  # of the crops of panoramas that show the sun, aimed at it
    joined: float = 0.0  # of the crops, divided by a line between two places under the same sun
    stretched: float = 0.0  # of the crops, that show a stretched world under another sun
    surroundings: bool = False  # also learn the light all around the camera and its power
    sharpness: float = 0.45  # smallest share of the canvas's resolution that a crop keeps
    licensed_only: bool = False  # train on permissively licensed panoramas and photos alone
    pretrained: bool = True
    only_seen: bool = False  # train only the head that says where in the picture the sun is seen
    only_camera: bool = False  # train for the camera's angles alone, all layers
    teachers: tuple[str, ...] = ()  # folders of finished runs, whose mean answer is a second target of every crop
    blended: float = 0.4  # of the crops that teachers answer, blended with another; of mirror images twice as many
    mirrored: bool = False  # learn from every crop's mirror image, too: of it the camera is known, the sun by teachers
    start: str = ""  # folder of an earlier run: start from its averaged weights, with other crops
    synthetic: str = ""  # folder of `python -m export synthesize`, mixed in
    synthetic_share: float = 0.3  # of the crops, if there is such a folder
    photos_share: float = 0.0  # of the crops, of the folder's ordinary photos
    workers: int = 2
    checkpoint_minutes: float = 4.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "teachers", tuple(self.teachers))  # JSON has them as a list
