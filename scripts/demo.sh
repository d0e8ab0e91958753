#!/usr/bin/env bash
# Estimates the relative pose of two photographs in demo/, draws it, and compares it with the known pose.
# usage: scripts/demo.sh [REFERENCE QUERY], names of pictures in demo/ without ending
set -euo pipefail
cd "$(dirname "$0")/.."

readonly REFERENCE=${1:-00049} QUERY=${2:-00047}

# fx,fy,cx,cy with pixel centres at integer + 0.5; cameras.json puts them at integers.
camera() {
  python3 - "$1" <<'PYTHON'
import json, sys
image = next(i for i in json.load(open("demo/cameras.json"))["images"] if i["file"] == sys.argv[1] + ".jpg")
(fx, _, cx), (_, fy, cy), _ = image["K"]
print(f"{fx},{fy},{cx + 0.5},{cy + 0.5}")
PYTHON
}

build/release/bin/antipode pose "demo/$REFERENCE.jpg" "demo/$QUERY.jpg" \
  --reference-mask "demo/${REFERENCE}_mask.png" --query-mask "demo/${QUERY}_mask.png" \
  --reference-camera "$(camera "$REFERENCE")" --query-camera "$(camera "$QUERY")" \
  --visualize build/demo.png --json build/demo.json

python3 - "$REFERENCE" "$QUERY" <<'PYTHON'
import json, math, sys
rotations = {i["file"][:-4]: i["R"] for i in json.load(open("demo/cameras.json"))["images"]}
reference, query = rotations[sys.argv[1]], rotations[sys.argv[2]]
estimate = json.load(open("build/demo.json"))["query_from_reference"]["rotation"]
# trace(R_estimate^T R_query R_reference^T) = 1 + 2 cos(error)
truth = [[sum(query[i][k] * reference[j][k] for k in range(3)) for j in range(3)] for i in range(3)]
trace = sum(estimate[i][j] * truth[i][j] for i in range(3) for j in range(3))
error = math.degrees(math.acos(max(-1.0, min(1.0, (trace - 1) / 2))))
turn = math.degrees(math.acos(max(-1.0, min(1.0, (sum(truth[i][i] for i in range(3)) - 1) / 2))))
print(f"Known pose: the camera turned by {turn:.0f} degrees; the estimate is {error:.1f} degrees off.")
print("Look at build/demo.png")
PYTHON
