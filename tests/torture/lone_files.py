"""Commands that write one file, `new` and `import`: killed, or two at a time; the file is whole or not there."""

import os
import random
import signal
import time
from pathlib import Path

from tests.files.reader import leftovers
from tests.torture.rows import Row
from tests.torture.trial import run

ROBOT = """<robot name="r{mass}">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.4 0 0"/><mass value="{mass}"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
</robot>"""


def lone_files(count: int, number: int, out: Path) -> Row:
    """Kill a writer at a random time, every other time with a second one beside it; then run once more."""
    row, chance = Row("files"), random.Random(number)
    for mass in (1, 2):
        (out / f"{mass}.urdf").write_text(ROBOT.format(mass=mass), encoding="utf-8")
    cases = {
        "new": (["new", "{}", "--like", "single-link"], ["new", "{}", "--like", "spinning-link"]),
        "import": (["import", str(out / "1.urdf"), "--out", "{}"], ["import", str(out / "2.urdf"), "--out", "{}"]),
    }
    whole = {name: {written(one, out / name / "own.toml") for one in both} for name, both in cases.items()}
    for at in range(count):
        name = chance.choice(list(cases))
        path = out / f"{name}-{at}" / "own.toml"
        path.parent.mkdir()
        first, second = ([word.format(path) for word in one] for one in cases[name])

        def stop(child: int, second: list[str] = second, at: int = at, wait: float = chance.expovariate(8.0)) -> None:
            if at % 2:
                row.count(run(second), f"{second[0]} beside {at}")
            time.sleep(wait)
            os.kill(child, signal.SIGKILL)

        run(first, stop_after=stop)
        row.runs += 1
        if path.exists() and path.read_bytes() not in whole[name]:
            row.mixed += 1
            row.wrong.append(f"half written: {name} {at}")
        row.count(run(first), f"{name} after {at}")
        if not path.exists() or path.read_bytes() not in whole[name] or leftovers(path):
            row.left += 1
            row.wrong.append(f"left by {name} {at}: {leftovers(path)}")
    return row


def written(words: list[str], path: Path) -> bytes:
    """What a run that nobody disturbs writes."""
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    run([word.format(path) for word in words])
    return path.read_bytes()
