"""What an answer of `partpose serve` costs beside an image of `partpose run`: the same images, network and models, warm.

    python3 scripts/serve_cost.py PARTPOSE [--images DIR --camera FILE] [--copies N] [--rounds N]

PARTPOSE is the program with the feature `serve`. `run` does the images once and N + 1 times as often; the difference has
no start in it. The server is asked for each image once, which warms it, and then for N copies of all, two at a time, as
many as its workers. Rounds alternate between the two; what is printed are seconds of the processors (system included) and
of the clock an image, and the ratios. Other work on the machine changes the clock's seconds far more than the others.
"""

import argparse
import concurrent.futures
import http.client
import os
import pathlib
import re
import resource
import shutil
import signal
import statistics
import subprocess
import tempfile
import time


def run(program, images, camera, out):
    """Seconds of processors and clock that `run` takes."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [program, "run", images, "--camera", camera, "--no-pictures", "--out", out]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, time.perf_counter() - start


def ask(address, path):
    connection = http.client.HTTPConnection(address, timeout=300)
    connection.request("POST", "/v1/estimate", path.read_bytes(), {"Content-Type": "application/octet-stream"})
    answer = connection.getresponse()
    body = answer.read()
    assert answer.status == 200, body


def cpu_of(process):
    fields = pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("partpose")
    parser.add_argument("--images", default="examples/world/vkitti_1.3.1_rgb", type=pathlib.Path)
    parser.add_argument("--camera", default="examples/world")
    parser.add_argument("--copies", default=4, type=int)
    parser.add_argument("--rounds", default=3, type=int)
    given = parser.parse_args()
    images = sorted(path for path in given.images.rglob("*") if path.suffix in (".png", ".jpg", ".jpeg"))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name, copies in ("few", 1), ("many", given.copies + 1):
            for copy in range(copies):
                for number, path in enumerate(images):
                    target = folder / name / f"{copy}-{number}{path.suffix}"
                    target.parent.mkdir(exist_ok=True)
                    shutil.copyfile(path, target)
        with open(folder / "log", "w") as log:
            command = [given.partpose, "serve", "--port", "0", "--camera", given.camera, "--workers", "2"]
            server = subprocess.Popen(command, stderr=log)
        try:
            while not (found := re.search(r"http://(\S+)", (folder / "log").read_text())):
                assert server.poll() is None, (folder / "log").read_text()
                time.sleep(0.2)
            asked = sorted((folder / "many").iterdir())[len(images) :]
            with concurrent.futures.ThreadPoolExecutor(2) as pool:
                list(pool.map(lambda path: ask(found[1], path), images))
                for number in range(given.rounds):
                    few = run(given.partpose, folder / "few", given.camera, folder / f"few-{number}")
                    many = run(given.partpose, folder / "many", given.camera, folder / f"many-{number}")
                    cpu, start = cpu_of(server.pid), time.perf_counter()
                    list(pool.map(lambda path: ask(found[1], path), asked))
                    served = cpu_of(server.pid) - cpu, time.perf_counter() - start
                    rows.append([(m - f) / len(asked) for m, f in zip(many, few)] + [s / len(asked) for s in served])
        finally:
            server.send_signal(signal.SIGTERM)
            server.wait()
    print("seconds an image: run's processors and clock, serve's processors and clock; load", os.getloadavg()[0])
    for row in rows:
        print("  ".join(f"{value:.3f}" for value in row))
    ratios = [[row[2] / row[0], row[3] / row[1]] for row in rows]
    cpu, clock = (statistics.median(ratio[i] for ratio in ratios) for i in (0, 1))
    print(f"serve takes {cpu:.3f} of run's processors and {clock:.3f} of its clock (medians)")


if __name__ == "__main__":
    main()
