#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# valgrind.sh TESTS WHITTED BDPT: tests of the library and of scene import (in the folder TESTS), and tiny frames of both
# renderers in all modes, from loading to writing, under memcheck: no read of what nobody wrote, none beyond a block, no
# lost memory. (Leaks that Embree's and TBB's threads "possibly" leave are not counted.) Prints TAP.
set -u
tests=$(realpath -- "$1") || exit 2
whitted=$(realpath -- "$2") || exit 2
bdpt=$(realpath -- "$3") || exit 2
if ! command -v valgrind >/dev/null; then
    echo "1..0 # SKIP no valgrind"
    exit 0
fi
dir=$(mktemp -d) || exit 2
trap 'rm -rf -- "$dir"' EXIT
number=0 bad=0

# check NAME COMMAND ...
check() {
    local name=$1
    shift
    number=$((number + 1))
    # "indirect" blocks hang on lost ones
    if (cd "$dir" && valgrind -q --error-exitcode=99 --leak-check=full --show-leak-kinds=definite,indirect \
        --errors-for-leak-kinds=definite,indirect "$@") >"$dir/said" 2>&1; then
        echo "ok $number - $name"
    else
        echo "not ok $number - $name: exit $?"
        tail -n 40 "$dir/said" | sed 's/^/# /'
        bad=1
    fi
}

for name in odd_values vertices kernels grid estimate_pair options scene_import; do
    check "test_$name" "$tests/test_$name"
done
frame=(cornell --size 20x14 --spp 2 --quiet --json x.json -o x.exr -o x.png)
for mode in exact cache estimate adaptive; do
    check "whitted, $mode" "$whitted" "${frame[@]}" --vpls 16 --threads 1 --visibility $mode
done
{
    printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n'
    printf '\200\200\200\200%.0s' {1..7}
    printf '\377\377\377\203'
} >"$dir/sky.hdr"
check "whitted, grid" "$whitted" "${frame[@]}" --env sky.hdr --env-lights 8 --env-samples 0 --vpls 0 --threads 1 --visibility grid --spp 1
for mode in exact cache estimate; do
    check "bdpt, $mode" "$bdpt" "${frame[@]}" --threads 2 --deterministic --visibility $mode
done
echo "1..$number"
exit $bad
