"""Makes the pictures beside this file that OpenCV cannot write. Needs Pillow and NumPy.

Every picture shows the same scene, 24 x 16 pixels: grey with a red top left and a blue top right corner.
"""

import pathlib

import numpy as np
from PIL import Image, ImageOps

FOLDER = pathlib.Path(__file__).parent
ORIENTATION, EXIF_IFD, FOCAL_LENGTH_35MM = 0x0112, 0x8769, 0xA405
# What has to be done to the upright picture so that the orientation tag undoes it.
STORED_FROM_UPRIGHT = {
    1: None,
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_90,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_270,
}


def scene():
    pixels = np.full((16, 24, 3), 128, np.uint8)
    pixels[:8, :8] = (255, 0, 0)
    pixels[:8, 16:] = (0, 0, 255)
    return Image.fromarray(pixels)


def exif(orientation, focal_length):
    tags = Image.Exif()
    tags[ORIENTATION] = orientation
    tags.get_ifd(EXIF_IFD)[FOCAL_LENGTH_35MM] = focal_length
    return tags


def main():
    picture = scene()
    jpeg = {"quality": 90, "subsampling": 0}
    for orientation, operation in STORED_FROM_UPRIGHT.items():
        stored = picture if operation is None else picture.transpose(operation)
        path = FOLDER / f"orientation_{orientation}.jpg"
        stored.save(path, exif=exif(orientation, 35), **jpeg)
        shown = np.asarray(ImageOps.exif_transpose(Image.open(path)), int)
        assert shown.shape == (16, 24, 3) and np.abs(shown - np.asarray(picture)).mean() < 4
    rotated = picture.transpose(STORED_FROM_UPRIGHT[6])
    rotated.save(FOLDER / "orientation_6.png", exif=exif(6, 35))
    rotated.save(FOLDER / "orientation_6.webp", exif=exif(6, 35), lossless=True)
    picture.save(FOLDER / "focal_length_unknown.jpg", exif=exif(1, 0), **jpeg)
    picture.save(FOLDER / "progressive.jpg", progressive=True, **jpeg)
    picture.convert("CMYK").save(FOLDER / "cmyk.jpg", **jpeg)
    right_half = np.zeros((16, 24), np.uint8)
    right_half[:, 12:] = 255
    grey = picture.convert("LA")
    grey.putalpha(Image.fromarray(right_half))
    grey.save(FOLDER / "grey_alpha.png")
    picture.convert("P", palette=Image.Palette.ADAPTIVE).save(FOLDER / "palette.png")
    picture.save(FOLDER / "still.gif")

    frames = {"save_all": True, "append_images": [picture.rotate(180)], "duration": 100}
    picture.save(FOLDER / "animated.gif", **frames)
    picture.save(FOLDER / "animated.png", **frames)
    picture.save(FOLDER / "animated.webp", **frames)


if __name__ == "__main__":
    main()
