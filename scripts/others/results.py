"""The results that `partpose run` wrote: what others must find, too."""

import json
import pathlib


def read(folder):
    """Every image's result, in the order of the files' names; other JSON is passed over."""
    read = [json.loads(path.read_text()) for path in sorted(pathlib.Path(folder).glob("*.json"))]
    return [result for result in read if "vehicles" in result]


def posed(result):
    """The vehicles that have a pose."""
    return [vehicle for vehicle in result["vehicles"] if "pose" in vehicle]
