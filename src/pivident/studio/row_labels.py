"""What the keys of an experiment file are called on the page."""

from __future__ import annotations

from pivident.text.toml_places import Place

#: Keys that most files have, in words; all others go by their names.
LABELS = {
    "robot.model": "Robot",
    "robot.friction": "Friction of all joints",
    "robot.rotor_inertia": "Rotor inertias",
    "robot.reduction": "Gear ratios",
    "robot.drive_gain": "Gains of the drives",
    "robot.joints": "Joints",
    "robot.frozen": "Joints that do not move",
    "robot.gravity": "Direction of gravity",
    "recording.files": "Log",
    "recording.name": "Name of the run",
    "recording.rate": "Sampling rate",
    "recording.control_rate": "Rate of the control loop",
    "recording.part": "Trim",
    "recording.resample": "Interpolate onto a uniform clock",
    "recording.delay": "Torque later than position",
    "recording.drive_delay": "Delay of the drives",
    "recording.side": "Side of the gear",
    "recording.torque_side": "Where torque is measured",
    "recording.torque_timing": "What a torque sample is",
    "recording.position_offset": "Added to positions",
    "recording.saturation": "Torques cut off at a limit",
    "recording.allow_constant": "Joints that do not move",
    "recording.column_names": "Names of the columns",
    "controller.type": "Control law",
    "controller.reference": "Source of the reference",
    "controller.kp": "Proportional gains",
    "controller.kd": "Derivative gains",
    "controller.ki": "Integral gains",
    "controller.kv": "Gains of the speed loop",
    "controller.drive_gain": "Torque per output of the law",
    "controller.limit": "Largest output of the law",
    "controller.feed_forward": "Feed-forward",
    "identify.methods": "Methods",
    "identify.mask": "Samples at standstill",
    "identify.parameters": "Parameters",
    "validation.folds": "Held-out blocks",
    "output.folder": "Folder of results",
    "output.title": "Title of the report",
}

#: Signals in words.
SIGNALS = {
    "t": "time", "q": "position", "dq": "speed", "tau": "torque", "q_ref": "reference position",
    "dq_ref": "reference speed", "ddq_ref": "reference acceleration",
    "q_link": "position behind the gear",
}  # fmt: skip


def label_of(place: Place) -> str:
    """A key in words; empty for one that goes by its name."""
    names = [part for part in place if isinstance(part, str)]
    table, key = names[-2:] if len(names) > 1 else ("", names[0])
    if table == "units" and key in SIGNALS:
        return f"Unit of {SIGNALS[key]}"
    if table == "columns" and key in SIGNALS:
        return f"Column{'' if key == 't' else 's'} of {SIGNALS[key]}"
    return LABELS.get(".".join(names), "")
