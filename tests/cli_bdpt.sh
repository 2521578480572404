#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs bdpt as a user would: what is its own, beside what cli.sh checks of both programs' common parts. Prints TAP.
# Usage: cli_bdpt.sh BDPT
set -u
shopt -s nullglob dotglob

if [[ $# -ne 1 || ! -x $1 ]]; then
    echo "usage: cli_bdpt.sh BDPT" >&2
    exit 2
fi
program=$(realpath -- "$1") || exit 2
# shellcheck source-path=SCRIPTDIR
. "$(dirname -- "$(realpath -- "$0")")/tap.sh"

tiny=(cornell --size 32x18 --threads 1)

good --help
[[ $(lines stdout) -le 40 && ! -s stderr ]] || problem "more than 40 lines of help"
awk 'length > 100 { exit 1 }' stdout || problem "a line of help is longer than 100 columns"
for option in resume time epoch env-rotate visibility ce heuristic edges strategy cache-mb; do
    grep -q -- "--$option " stdout || problem "no --$option in the help"
done
finish "--help fits one screen"

for mode in exact cache estimate; do
    good "${tiny[@]}" --visibility $mode --spp 4 --compare -o out/x.exr -o out/x.png --picture out/p.png --json out/x.json
    is_exr out/x.exr
    is_png out/x.png
    is_png out/p.png
    read_json out/x.json
    has_keys scene triangles spp epoch ce heuristic cache_mb exact.frame_s exact.shade_s exact.rays mode_run.rays_asked \
        mode_run.rays_traced mode_run.camera_rays error.l_inf speedup.frame
    figure_is mode "\"$mode\""
    figure_is complete true
    figure_is mode_run.passes 4
    no_temporaries out
    rm -rf out && mkdir out
done
finish "images and figures of all modes"

# difference NAME A.exr: l_inf of a rendering like A's to A, as bdpt counts it
good "${tiny[@]}" --visibility exact --spp 12 -o whole.exr --json whole.json --quiet
for mode in exact cache; do
    quiet_good "${tiny[@]}" --visibility $mode --epoch 4 --spp 12 -o whole-$mode.exr
    quiet_good "${tiny[@]}" --visibility $mode --epoch 4 --spp 4 -o part-$mode.exr
    quiet_good "${tiny[@]}" --visibility $mode --epoch 4 --spp 12 --resume part-$mode.exr --reference whole-$mode.exr \
        --json resumed.json -o resumed-$mode.exr
    read_json resumed.json
    figure_is reference.mode_run.l_inf 0
    figure_is mode_run.passes 12
    quiet_good "${tiny[@]}" --visibility $mode --epoch 4 --spp 16 --resume resumed-$mode.exr -o more.exr
    same part-$mode.exr whole-$mode.exr && problem "12 passes look like 4"
done
finish "--resume goes on to what an unbroken run has"

clean_failure 1 "--seed 0, not 5" "${tiny[@]}" --visibility exact --seed 5 --spp 12 --resume part-exact.exr -o out/x.exr
clean_failure 1 "--visibility exact, not cache" "${tiny[@]}" --visibility cache --spp 12 --resume part-exact.exr -o out/x.exr
clean_failure 1 "another scene" shapes --quiet --size 32x18 --visibility exact --spp 12 --resume part-exact.exr -o out/x.exr
for k in 1 2; do # the same room in another colour
    mkdir -p room$k
    printf 'newmtl a\nKd 0.%s 0.5 0.5\nKe 1 1 1\n' $k >room$k/a.mtl
    printf 'mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >room$k/a.obj
done
room=(--quiet --size 8x8 --visibility exact --look 0.3,0.3,2,0.3,0.3,0,40)
quiet_good room1/a.obj "${room[@]}" --spp 1 -o room.exr
quiet_good room1/a.obj "${room[@]}" --spp 2 --resume room.exr -o room.exr
clean_failure 1 "other materials, instances, lights or another sky" room2/a.obj "${room[@]}" --spp 3 --resume room.exr
clean_failure 1 "another camera" "${tiny[@]}" --look 0,1,2,0,0,0,40 --visibility exact --spp 12 --resume part-exact.exr
clean_failure 1 "--heuristic power, not balance" "${tiny[@]}" --heuristic balance --visibility exact --spp 12 --resume part-exact.exr
clean_failure 1 "--ce 12, not 5" "${tiny[@]}" --visibility cache --epoch 4 --ce 5 --spp 12 --resume part-cache.exr
clean_failure 1 "32x18 pixels" cornell --size 16x9 --visibility exact --spp 12 --resume part-exact.exr
clean_failure 1 "4 passes already" "${tiny[@]}" --visibility exact --spp 4 --resume part-exact.exr
quiet_good "${tiny[@]}" --visibility exact --spp 4 --half -o half.exr
clean_failure 1 "32-bit floats" "${tiny[@]}" --visibility exact --spp 12 --resume half.exr
clean_failure 1 "no-such-file" "${tiny[@]}" --visibility exact --spp 12 --resume no-such-file.exr
clean_failure 1 "not an OpenEXR" "${tiny[@]}" --visibility exact --spp 12 --resume resumed.json
head -c 3000 part-exact.exr >cut.exr
clean_failure 1 "cut.exr" "${tiny[@]}" --visibility exact --spp 12 --resume cut.exr
clean_failure 2 "--compare" "${tiny[@]}" --compare --resume part-exact.exr
clean_failure 2 "--strategy" "${tiny[@]}" --strategy 99
clean_failure 2 "--epoch" "${tiny[@]}" --epoch 0
clean_failure 2 "--visibility" "${tiny[@]}" --visibility maybe
finish "what cannot be gone on from, and bad values, are refused in one line"

quiet_good "${tiny[@]}" --spp 100000 --time 0.5 --json time.json
read_json time.json
figure_is complete true
[[ ${figure[mode_run.passes]} -ge 1 && ${figure[mode_run.passes]} -lt 100000 ]] || problem "--time does not end it"
finish "--time ends a rendering between two passes"

for file in 1 3; do
    quiet_good "${tiny[@]}" --visibility exact --spp 2 --threads $file -o threads$file.exr
done
good "${tiny[@]}" --visibility exact --spp 2 --threads 2 --reference threads1.exr --json threads.json --quiet
read_json threads.json
figure_is reference.mode_run.l_inf 0
for mode in cache estimate; do
    quiet_good "${tiny[@]}" --visibility $mode --spp 4 -o one.exr --json one.json
    good "${tiny[@]}" --visibility $mode --spp 4 --threads 3 --deterministic --reference one.exr --json three.json --quiet
    read_json one.json
    rays=${figure[mode_run.rays_traced]}
    read_json three.json
    figure_is reference.mode_run.l_inf 0
    figure_is mode_run.rays_traced "$rays"
    figure_is deterministic true
done
finish "exact images do not depend on threads, others not with --deterministic"

# power of 1e38 W/sr times 4 pi is beyond floats; of 2.5e37 what arrives from near by, unweighted
for lamp in '1 0.3,0.3,0.5' '1e37 0.3,0.3,0.5' '2.5e37 0.3,0.3,0.05' '1e38 0.3,0.3,0.5'; do
    lamp_gltf $lamp >lamp.gltf
    beyond=0
    [[ $lamp == 2.5e37* || $lamp == 1e38* ]] && beyond=1
    for mode in exact cache estimate; do
        lit=(lamp.gltf --size 16x16 --spp 4 --look 0.3,0.3,2,0.3,0.3,0,40 --visibility $mode --edges 2 --strategy 1)
        good "${lit[@]}" --json lamp.json
        read_json lamp.json
        left=${figure[mode_run.not_finite]}
        [[ $said == *"notice: $left contributions are left out: "* || $said != *"left out"* && $left == 0 ]] ||
            problem "$mode, $lamp: $left are left out ($said)"
        (((left > 0) == beyond)) || problem "$mode, $lamp: $left said ($said)"
        quiet_good "${lit[@]}"
    done
done
finish "light that floats cannot hold is said"

# sums of the pilot paths must not take what comes after them for nothing
for intensity in 1e30 1e37; do
    lamp_gltf $intensity 0.3,0.3,0.5 >lamp.gltf
    quiet_good lamp.gltf --size 256x144 --spp 1 --look 0.3,0.3,2,0.3,0.3,0,40 --visibility exact --json lamp.json
    read_json lamp.json
    [[ $intensity == 1e30 ]] && rays=${figure[mode_run.rays_traced]}
done
[[ ${figure[mode_run.rays_traced]} -ge $rays ]] || problem "${figure[mode_run.rays_traced]} rays, not $rays"
finish "light that floats can hold is not lost"

if ! env --default-signal=INT true 2>/dev/null; then
    skip "interrupts" "this env cannot reset signals"
else
    # small: many passes are done by then, however slow the machine is
    start cornell --size 48x27 --spp 100000 --visibility exact -o out/x.exr --json out/x.json
    kill -INT "$child"
    reap
    [[ $rc -eq 130 && $said == "notice: interrupted: "* ]] || problem "exit $rc instead of 130 ($said)"
    ((waited < 5000)) || problem "took $waited ms"
    is_exr out/x.exr
    read_json out/x.json
    figure_is complete false
    passes=${figure[mode_run.passes]}
    good cornell --size 48x27 --spp $((passes + 1)) --visibility exact --resume out/x.exr --json out/y.json --quiet
    read_json out/y.json
    figure_is mode_run.passes $((passes + 1))
    finish "SIGINT keeps the passes that are done, and they are gone on from"

    start cornell --size 320x180 --spp 100000 --threads 3 --deterministic -o out/x.exr --quiet
    kill -INT "$child"
    reap
    [[ $rc -eq 130 ]] || problem "threads that wait for their turns: exit $rc instead of 130"
    ((waited < 5000)) || problem "threads that wait for their turns took $waited ms"
    finish "SIGINT ends threads that wait for their turns"

    rm -rf out && mkdir out
    start cornell --size 1600x1200 --threads 1 --visibility exact -o out/x.exr --quiet
    kill -INT "$child"
    reap
    [[ $rc -eq 130 ]] || problem "exit $rc instead of 130 ($said)"
    is_exr out/x.exr
    mv out/x.exr begun.exr
    clean_failure 1 "no pass" cornell --size 1600x1200 --visibility exact --spp 20 --resume begun.exr
    finish "SIGINT within the first pass leaves a picture, but nothing to go on from"

    # mostly while first hits are looked for again: the file must keep its depth and normals
    quiet_good cornell --size 640x360 --spp 1 --visibility exact -o kept.exr
    start cornell --size 640x360 --threads 1 --spp 100000 --visibility exact --resume kept.exr -o kept.exr --quiet
    kill -INT "$child"
    reap
    [[ $rc -eq 130 ]] || problem "exit $rc instead of 130 ($said)"
    good cornell --size 640x360 --spp 1000 --time 0.1 --visibility exact --resume kept.exr --json out/y.json --quiet
    read_json out/y.json
    [[ ${figure[mode_run.passes]} -ge 2 ]] || problem "nothing to go on from"
    finish "SIGINT at the start of --resume leaves a file to go on from"

    rm -rf out && mkdir out
    interrupt_loading
fi

tap_end
