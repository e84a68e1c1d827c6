"""Asks the server with Triton's HTTP client, and with plain HTTP, and compares the answers with those of `partpose run`."""

import http.client
import json
import pathlib
import statistics
import sys
import threading
import time

import numpy as np
import tritonclient.http as triton
from PIL import Image
from results import posed, read

address, images, folder = sys.argv[1:]
results = read(folder)
paths = [pathlib.Path(images) / result["image"] for result in results]
client = triton.InferenceServerClient(address)
assert client.is_server_live() and client.is_server_ready() and client.is_model_ready("partpose")
print("server:", client.get_server_metadata())
print("inputs:", client.get_model_metadata("partpose")["inputs"])


def camera_of(result):
    camera = result["camera"]
    return np.array(camera["focal"] + camera["principal_point"])


def compare(answer, result):
    """The arrays and the whole result of an answer are those of the run."""
    vehicles = posed(result)
    assert np.allclose(answer.as_numpy("translations"), np.array([v["pose"]["translation"] for v in vehicles]).reshape(-1, 3))
    assert np.allclose(answer.as_numpy("boxes"), np.array([v["bounds"] for v in vehicles]).reshape(-1, 4))
    # JSON gives texts, binary tensors bytes.
    found = [name if isinstance(name, str) else name.decode() for name in answer.as_numpy("models")]
    assert found == [v["pose"]["model"] for v in vehicles]
    whole = json.loads(answer.as_numpy("result")[0])
    assert whole["vehicles"] == result["vehicles"]


names = ["translations", "boxes", "models", "result"]
for path, result in zip(paths, results):
    pixels = np.array(Image.open(path).convert("RGB"))
    image = triton.InferInput("image", pixels.shape, "UINT8")
    camera = triton.InferInput("camera", [4], "FP64")
    camera.set_data_from_numpy(camera_of(result))
    for binary in (True, False):
        image.set_data_from_numpy(pixels, binary_data=True)
        outputs = [triton.InferRequestedOutput(name, binary_data=binary) for name in names]
        compare(client.infer("partpose", [image, camera], outputs=outputs, request_id=result["image"]), result)
    encoded = triton.InferInput("image", [1], "BYTES")
    encoded.set_data_from_numpy(np.array([path.read_bytes()], dtype=object))
    compare(client.infer("partpose", [encoded, camera], model_version="1"), result)
print(f"KServe: {len(results)} images are answered as `run` does, by Triton's client")


def post(body, query="", kind="image/png"):
    """Status and answer of the plain endpoint."""
    connection = http.client.HTTPConnection(address, timeout=120)
    connection.request("POST", "/v1/estimate" + query, body, {"Content-Type": kind})
    answer = connection.getresponse()
    text = answer.read()
    return answer.status, json.loads(text)


def query_of(result):
    fx, fy, cx, cy = camera_of(result)
    return f"?fx={fx!r}&fy={fy!r}&cx={cx!r}&cy={cy!r}".replace("np.float64(", "").replace(")", "")


for path, result in zip(paths, results):
    status, answer = post(path.read_bytes(), query_of(result))
    assert status == 200 and answer["vehicles"] == result["vehicles"], answer

for body, kind, expected in [
    (b"no picture", "image/png", 400),
    (paths[0].read_bytes()[:1000], "image/png", 400),
    (b"\0" * (5 << 20), "image/png", 413),
    (b"{", "application/json", 400),
    (b"x", "text/plain", 415),
]:
    status, answer = post(body, kind=kind)
    assert status == expected and answer["error"], (status, answer)
    print(status, answer["error"])
try:
    wrong = triton.InferInput("image", [2, 2], "UINT8")
    wrong.set_data_from_numpy(np.zeros((2, 2), np.uint8))
    client.infer("partpose", [wrong])
    raise SystemExit("a wrong shape was taken")
except triton.InferenceServerException as refused:
    print(refused)

# Too many at once: some are answered, the others are refused, none is lost.
statuses = []
body, query = paths[0].read_bytes(), query_of(results[0])
threads = [threading.Thread(target=lambda: statuses.append(post(body, query)[0])) for _ in range(16)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print("16 at once:", {status: statuses.count(status) for status in sorted(set(statuses))})
assert set(statuses) <= {200, 503} and 200 in statuses and len(statuses) == 16

seconds = []
for _ in range(3):
    for path, result in zip(paths, results):
        data, start = path.read_bytes(), time.perf_counter()
        assert post(data, query_of(result))[0] == 200
        seconds.append(time.perf_counter() - start)
print(f"one after the other: {statistics.mean(seconds):.3f} s an image, median {statistics.median(seconds):.3f}")
