# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of every operation, from native/options/options.toml as of the build."""

import json
from pathlib import Path
from typing import Any

TABLE: dict[str, Any] = json.loads(Path(__file__).with_name("options.json").read_text(encoding="utf-8"))


def presets_of(operation: str) -> dict[str, dict[str, Any]]:
    """{name: label, sentence and values} of an operation's presets."""
    return dict(TABLE[operation]["presets"])


def options_of(operation: str) -> dict[str, dict[str, Any]]:
    """{name: declaration (type, default, low, high, sentence, …)} of an operation's options, in order."""
    block = TABLE[operation]
    return {option["name"]: option for option in (*block["options"], *block["further"])}
