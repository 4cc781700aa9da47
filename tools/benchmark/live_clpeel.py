"""clpeel's live view of a scene, as a user starts it: `python -m benchmark.live_clpeel SCENE WIDTH HEIGHT`.

SCENE is a list [name, numbers...] in JSON. The address of the page is printed.
"""

from __future__ import annotations

import json
import sys

from benchmark.makers import CAMERA, make
from clpeel.viewer.open import view

if __name__ == "__main__":
    scene, width, height = (json.loads(word) for word in sys.argv[1:])
    view(make(*scene), CAMERA, (width, height), lighting="none", backend="browser", open_page=False)
