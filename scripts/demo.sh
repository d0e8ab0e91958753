#!/usr/bin/env bash
# Estimates the relative pose of two photographs in demo/, compares it with the true one and draws a picture.
#
# usage: scripts/demo.sh [OBJECT REFERENCE QUERY]
#   scripts/demo.sh buddha 00046 00018  views 42 degrees apart, the camera rolled (default)
#   scripts/demo.sh skull 18 33         61 degrees
#   scripts/demo.sh skull 18 43         123 degrees
set -euo pipefail
cd "$(dirname "$0")/.."

object=${1:-buddha}
reference=${2:-00046}
query=${3:-00018}
program=${ANTIPODE:-build/release/bin/antipode}
mkdir -p build

# fx,fy,cx,cy of an image; cameras.json counts pixel centres as integers, the program their edges.
camera_of() {
  python3 - "demo/$object/cameras.json" "$1" <<'PYTHON'
import json, sys
images = json.load(open(sys.argv[1]))["images"]
K = next(image["K"] for image in images if image["file"] == f"images/{sys.argv[2]}.jpg")
print(f"{K[0][0]},{K[1][1]},{K[0][2] + 0.5},{K[1][2] + 0.5}")
PYTHON
}

"$program" pose "demo/$object/images/$reference.jpg" "demo/$object/images/$query.jpg" \
  --reference-mask "demo/$object/masks/$reference.png" --query-mask "demo/$object/masks/$query.png" \
  --reference-camera "$(camera_of "$reference")" --query-camera "$(camera_of "$query")" \
  --visualize build/demo.png --json build/demo.json

python3 - "demo/$object/cameras.json" "$reference" "$query" <<'PYTHON'
import json, math, sys

path, reference, query = sys.argv[1:]
images = {image["file"]: image for image in json.load(open(path))["images"]}
a, b = images[f"images/{reference}.jpg"], images[f"images/{query}.jpg"]
estimate = json.load(open("build/demo.json"))["query_from_reference"]


def times(m, v):
    return [sum(m[i][k] * v[k] for k in range(3)) for i in range(3)]


def degrees_between(u, v):
    return math.degrees(math.acos(max(-1, min(1, sum(p * q for p, q in zip(u, v)) / math.hypot(*u) / math.hypot(*v)))))


# query_from_reference = query_from_world * reference_from_world^-1
rotation = [[sum(b["R"][i][k] * a["R"][j][k] for k in range(3)) for j in range(3)] for i in range(3)]
translation = [p - q for p, q in zip(b["t"], times(rotation, a["t"]))]
trace = sum(rotation[i][j] * estimate["rotation"][i][j] for i in range(3) for j in range(3))
print(f"True pose: rotation error {math.degrees(math.acos(max(-1, min(1, (trace - 1) / 2)))):.1f} degrees, "
      f"translation direction error {degrees_between(translation, estimate['translation']):.1f} degrees")
PYTHON
