"""Reads an MCAP file with the ROS 2 reader of its makers and compares it with the results it was made from."""

import sys

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from results import posed, read

path, folder = sys.argv[1:]
results = read(folder)
by_topic = {}
for message in read_ros2_messages(path):
    by_topic.setdefault(message.channel.topic, []).append((message.log_time_ns, message.ros_msg))
print({topic: len(messages) for topic, messages in by_topic.items()})

assert len(by_topic["/detections"]) == len(results)
for (time, message), result in zip(by_topic["/detections"], results):
    stamp = message.header.stamp
    assert stamp.sec * 1_000_000_000 + stamp.nanosec == time
    assert message.header.frame_id == "camera"
    assert len(message.detections) == len(posed(result))
    for detection, vehicle in zip(message.detections, posed(result)):
        pose = vehicle["pose"]
        extent, rotation = pose["extent"], np.array(pose["rotation"])
        center = np.array(pose["translation"]) - rotation[:, 1] * extent["height"] / 2
        position, size = detection.bbox.center.position, detection.bbox.size
        assert np.allclose([position.x, position.y, position.z], center, atol=1e-9)
        assert np.allclose([size.x, size.y, size.z], [extent["length"], extent["width"], extent["height"]])
        q = detection.bbox.center.orientation
        forward = [1 - 2 * (q.y**2 + q.z**2), 2 * (q.x * q.y + q.w * q.z), 2 * (q.x * q.z - q.w * q.y)]
        assert np.allclose(forward, rotation[:, 2], atol=1e-6)
        # Place first in ROS, rotation first in the results.
        known = np.array(pose["dense"]["covariance"])[:6, :6]
        known = np.roll(known, (3, 3), (0, 1)).ravel()
        assert np.allclose(detection.results[0].pose.covariance, known) and known[0] > 0
        assert detection.results[0].hypothesis.score == vehicle["score"]
for (_, info), result in zip(by_topic["/camera/camera_info"], results):
    camera = result["camera"]
    assert [info.width, info.height] == camera["size"]
    assert [info.k[0], info.k[4]] == camera["focal"]
    assert [info.k[2], info.k[5]] == camera["principal_point"]
for _, image in by_topic["/camera/image/compressed"]:
    assert image.format in ("png", "jpeg") and len(image.data) > 100
print(f"MCAP: {len(results)} images are as they should be")
