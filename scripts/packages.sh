# SPDX-License-Identifier: Apache-2.0
# Sourced by ./demo and ./check: installs the Debian/Ubuntu packages that are missing.

# libopenexr-dev brings OpenEXRCore; cmake is how Meson finds Embree and OpenEXR
packages=(build-essential meson ninja-build cmake pkg-config libembree-dev libopenexr-dev libassimp-dev libpng-dev
          libcjson-dev libstb-dev)

install_missing() {
    local missing=() name
    for name in "${packages[@]}" "$@"; do
        dpkg-query -W -f='${Status}' "$name" 2>/dev/null | grep -q 'install ok installed' || missing+=("$name")
    done
    # a newer Meson or CMake from elsewhere does as well
    local kept=()
    for name in "${missing[@]}"; do
        case $name in
        meson | cmake) command -v "$name" >/dev/null || kept+=("$name") ;;
        ninja-build) command -v ninja >/dev/null || kept+=("$name") ;;
        pkg-config) command -v pkg-config >/dev/null || kept+=("$name") ;;
        *) kept+=("$name") ;;
        esac
    done
    [ ${#kept[@]} -eq 0 ] && return 0

    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
            as_root=(sudo -n)
        elif command -v sudo >/dev/null && [ -t 0 ]; then
            as_root=(sudo)
        else
            echo "missing packages; as root, run: apt-get install ${kept[*]}" >&2
            return 1
        fi
    fi
    if ! command -v apt-get >/dev/null; then
        echo "missing packages (names as in Debian): ${kept[*]}" >&2
        return 1
    fi
    echo "installing ${kept[*]}"
    if ! { "${as_root[@]}" apt-get -qq update && DEBIAN_FRONTEND=noninteractive "${as_root[@]}" \
           apt-get -qq install -y --no-install-recommends "${kept[@]}"; } >/dev/null; then
        echo "could not install packages; as root, run: apt-get install ${kept[*]}" >&2
        return 1
    fi
}
