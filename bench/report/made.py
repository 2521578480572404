# SPDX-License-Identifier: Apache-2.0
"""What no folder of scenes has: files that the report makes for itself, in OUT/made."""
import os

from grid import made_map


def make(a):
    path = os.path.join(a.out, "made", "sun.hdr")
    if not os.path.exists(path):
        made_map(path, "sun")
