"""The options of the command line, each once, and the groups that commands take together."""

import argparse
from pathlib import Path
from typing import Any

from flexlin.bounds import read_number
from flexlin.resources import BYTES, SECONDS

LIMIT = f"{BYTES:.0e}".replace("+0", "")
"""Of memory, as one would write it."""


def count(text: str) -> int:
    """Read a whole number from 2 on."""
    number = int(text)
    if number < 2:
        raise argparse.ArgumentTypeError(f"got {number}, expected a whole number from 2 on")
    return number


def parse_place(text: str) -> Path:
    """Read the name of a file or folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("got an empty name, expected that of a file or folder")
    return Path(text)


def span(text: str) -> tuple[str, float, float, int | None]:
    """Read KEY=LOW:HIGH or KEY=LOW:HIGH:COUNT."""
    key, _, values = text.partition("=")
    low, high, *rest = values.split(":")
    found = (key.strip(), read_number(low), read_number(high), count(rest[0]) if rest else None)
    if not key.strip() or not found[1] < found[2] or len(rest) > 1:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected KEY=LOW:HIGH:COUNT with LOW below HIGH")
    return found


OPTIONS: dict[str, tuple[list[str], dict[str, Any]]] = {
    "scene": (["scene"], {"metavar": "SCENE", "help": "a built-in name (see flexlin list) or a TOML file"}),
    "name": (["name"], {"type": parse_place, "metavar": "NAME", "help": "of the new scene, which is written to NAME.toml"}),
    "like": (["--like"], {"default": "single-link", "metavar": "SCENE", "help": "the scene to start from (default: single-link)"}),
    "set": (
        ["--set"],
        {"dest": "overrides", "metavar": "KEY=VALUE", "action": "extend", "nargs": "+", "default": [],
         "help": "override values of the scene, in SI units or with their own: effects.payload.mass=0.3 links.0.length='960 mm'; lists in "
                 "brackets: control.feedback.kp=[5,2]; an effect on by its whole table: effects.shear={stiffness=1e5}, or off: "
                 "effects.gravity=off; "
                 "what stands in a model's [parameters] also without that word: links.0.modes=5"},
    ),
    "data": (
        ["--data"],
        {"type": parse_place, "metavar": "DIR", "help": "folder whose files the scene may name, beside its own"},
    ),
    "out": (["--out"], {"type": parse_place, "metavar": "DIR", "help": "folder for the results (default: out/ and the scene's name)"}),
    "require": (
        ["--require"],
        {"choices": ["stable", "valid", "linear-stable"],
         "help": "exit with code 3 unless the loop is stable in a linear model that holds along the motion as far as is known (stable), "
                 "was found to hold by simulation (valid), or may hold or not (linear-stable)"},
    ),
    "points": (["--points"], {"type": count, "default": 256, "help": "times in a period (default 256)"}),
    "periods": (["--periods"], {"type": float, "default": 5.0, "help": "length of the simulation (default 5)"}),
    "feedforward": (
        ["--feedforward"],
        {"choices": ["scene", "rigid", "joint-exact", "tip-exact"], "default": "scene",
         "help": "what to feed forward (default: as in the scene); tip-exact keeps the tip on its path"},
    ),
    "attraction": (
        ["--attraction"], {"action": "store_true", "help": "also find how far a disturbance may go (some seconds)"},
    ),
    "animate": (["--animate"], {"action": "store_true", "help": "also write animation.html, which plays the simulation"}),
    "effects": (["--effects"], {"action": "store_true", "help": "also find which effects matter (some seconds)"}),
    "over": (
        ["--over"],
        {"type": span, "metavar": "KEY=LOW:HIGH[:COUNT]", "action": "extend", "nargs": "+", "required": True,
         "help": "a parameter to vary, such as motion.frequency=0.2:3:200; give two for a map"},
    ),
    "vary": (
        ["--vary"],
        {"type": span, "metavar": "KEY=LOW:HIGH", "action": "extend", "nargs": "+", "default": [],
         "help": "a number that scenarios differ by, such as effects.payload.mass=0:0.3"},
    ),
    "gain": (
        ["--gain"],
        {"type": span, "metavar": "KEY=LOW:HIGH", "action": "extend", "nargs": "+", "default": [],
         "help": "a gain to tune and its limits (default: all of the scene's feedback, a tenth to ten times their values)"},
    ),
    "loop": (
        ["--loop"],
        {"default": "own", "metavar": "LOOP",
         "help": "own (default), open, a design's name, whose gain is kept, or 'NAME, redone' at each value"},
    ),
    "workers": (["--workers"], {"type": int, "metavar": "N", "help": "processes or threads that share the values (default: all cores)"}),
    "scheduler": (["--scheduler"], {"metavar": "ADDRESS", "help": "a Dask cluster that does the work, such as tcp://host:8786"}),
    "store": (
        ["--store"],
        {"type": parse_place, "metavar": "CHART.zarr", "help": "keep finished values; the same command goes on where it stopped"},
    ),
    "margins": (
        ["--margins"],
        {"type": span, "metavar": "KEY=LOW:HIGH", "action": "extend", "nargs": "+", "default": [],
         "help": "numbers whose critical values are looked for, with ranges (default: speed and payload, a second each)"},
    ),
    "loop_margins": (
        ["--loop-margins"],
        {"action": "store_true", "help": "also find which gain, phase and delay each loop endures (some seconds a loop)"},
    ),
    "sensitivity": (
        ["--sensitivity"],
        {"action": "store_true", "help": "also find which numbers move the growth rate (some seconds)"},
    ),
    "tol": (["--tol"], {"type": float, "metavar": "ERROR", "help": "wanted error of every stage (default 1e-9, or as in the scene)"}),
    "seconds": (
        ["--limit-seconds"],
        {"type": float, "metavar": "S",
         "help": f"time that the whole command may take (default {SECONDS:g}, tune 600, or as in the scene)"},
    ),
    "memory": (
        ["--limit-memory"],
        {"type": float, "metavar": "BYTES",
         "help": f"memory that it may hold beside its libraries (default {LIMIT}, or as in the scene)"},
    ),
    "log": (
        ["--log"],
        {"type": parse_place, "required": True, "metavar": "FILE", "help": "a measured log: CSV with a head line, .npz or .nc"},
    ),
    "free": (
        ["--free"],
        {"action": "extend", "nargs": "+", "required": True, "metavar": "KEY",
         "help": "numbers to find, such as effects.payload.mass or log.outputs.gauge.gain"},
    ),
    "hold_back": (
        ["--hold-back"],
        {"type": float, "default": 1 / 3, "metavar": "SHARE", "help": "last part of the log, predicted but not fitted (default a third)"},
    ),
    "window": (["--window"], {"type": float, "default": 2.0, "metavar": "S", "help": "length of each prediction (default 2)"}),
    "step": (["--step"], {"metavar": "WORDS", "help": 'a torque from a moment on, such as "joint 1 torque 0.1 N m"'}),
    "initial": (["--initial"], {"metavar": "WORDS", "help": 'a state beside the steady motion, such as "w11=0.01, q1_rate=5 deg/s"'}),
    "push": (["--push"], {"metavar": "WORDS", "help": 'a force at the tip for a time, such as "tip 1 N 20 ms" or "tip y 1 N 20 ms"'}),
    "noise": (["--noise"], {"metavar": "WORDS", "help": 'torque noise, such as "torque 0.05 N m 100 Hz"'}),
    "of": (["--loop"], {"dest": "of", "default": "own", "metavar": "NAME", "help": "own, or the name of a design (default own)"}),
    "lasting": (
        ["--periods"], {"dest": "lasting", "type": float, "help": "how long to look (default: until a thousandth is left)"},
    ),
    "robot": (["robot"], {"type": parse_place, "metavar": "ROBOT.URDF", "help": "a URDF file; no mesh is read"}),
    "file": (["--out"], {"type": parse_place, "required": True, "metavar": "FILE.TOML", "help": "the scene to write"}),
    "base": (["--base"], {"metavar": "LINK", "help": "first link of the chain (default: the root)"}),
    "tip": (["--tip"], {"metavar": "LINK", "help": "last link of the chain (default: the only end)"}),
    "tolerance": (["--tolerance"], {"type": float, "default": 0.01, "help": "relative change that matters (default 0.01)"}),
}  # fmt: skip
SCENE = ("scene", "set", "data", "out")
LIMITS = ("seconds", "memory")
COMPUTED = (*SCENE, "tol", *LIMITS)
