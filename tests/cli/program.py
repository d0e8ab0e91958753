"""What the end-to-end tests share: runs the program, and makes pictures and weights with the standard library."""
import concurrent.futures
import hashlib
import json
import math
import pathlib
import shutil
import struct
import subprocess
import sys
import zlib

SKIPPED = 77


class Program:
    """The built program, with a model."""

    def __init__(self, path, model):
        self.path, self.model = str(path), pathlib.Path(model)

    def run(self, *arguments, environment=None):
        return subprocess.run([self.path, *map(str, arguments)], capture_output=True, text=True, errors="replace",
                              env=environment, timeout=300, check=False)


def require_files(program):
    """Ends the test as skipped where the model is not there yet."""
    if not (program.model / "model.json").is_file():
        print(f"skipped: no model in {program.model}")
        sys.exit(SKIPPED)


def run_checks(checks):
    """Runs (name, function) pairs, two at a time; a check fails by an exception. Returns the exit code."""
    failures = 0
    with concurrent.futures.ThreadPoolExecutor(max_workers=2) as pool:
        futures = [(name, pool.submit(function)) for name, function in checks]
        for name, future in futures:
            try:
                future.result()
                print(f"ok    {name}", flush=True)
            except Exception as error:  # pylint: disable=broad-except
                failures += 1
                print(f"FAIL  {name}: {error or type(error).__name__}", flush=True)
    print(f"{len(checks) - failures} of {len(checks)} passed")
    return 1 if failures else 0


def expect(condition, message):
    if not condition:
        raise AssertionError(message)


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, pixel, channels=3, depth=8):
    """A PNG whose value at (x, y) is the tuple pixel(x, y), 0..255."""
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            for value in pixel(x, y):
                rows += bytes([value]) if depth == 8 else struct.pack(">H", value * 257)
    colour_type = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header) + png_chunk(b"IDAT", zlib.compress(bytes(rows), 1)) +
            png_chunk(b"IEND", b""))


WIDTH, HEIGHT = 96, 72


def in_object(x, y):
    """An egg in the middle of the picture."""
    return ((x - 48) / 26) ** 2 + ((y - 36) / 20) ** 2 < 1


def photo(depth=8, turn=0.0):
    def pixel(x, y):
        if not in_object(x, y):
            return (235, 236, 238)
        angle = math.atan2(y - 36, x - 48) + turn
        return (int(128 + 100 * math.cos(angle)), int(128 + 90 * math.sin(2 * angle)), 60 + 2 * y)
    return png(WIDTH, HEIGHT, pixel, 3, depth)


def mask(inside=in_object, width=WIDTH, height=HEIGHT):
    return png(width, height, lambda x, y: (255 if inside(x, y) else 0,), 1)


class Weights:
    """A safetensors file taken apart, to be damaged and written again."""

    def __init__(self, path):
        content = pathlib.Path(path).read_bytes()
        length = struct.unpack("<Q", content[:8])[0]
        self.header = json.loads(content[8:8 + length])
        self.data = bytearray(content[8 + length:])

    def names(self):
        return sorted(name for name in self.header if name != "__metadata__")

    def largest(self):
        return max(self.names(), key=lambda name: self.header[name]["data_offsets"][1] - self.header[name]["data_offsets"][0])

    def bytes(self):
        header = json.dumps(self.header).encode()
        header += b" " * (-len(header) % 8)
        return struct.pack("<Q", len(header)) + header + bytes(self.data)


def write_model(folder, source, content, **changes):
    """A model folder whose model.json fits `content`, so that the damage itself must be found."""
    folder.mkdir(parents=True)
    shutil.copy(source / "card.md", folder)
    description = json.loads((source / "model.json").read_text())
    description.update(name=folder.name, bytes=len(content), sha256=hashlib.sha256(content).hexdigest())
    description.update(changes)
    (folder / description["file"]).write_bytes(content)
    (folder / "model.json").write_text(json.dumps(description))
    return folder
