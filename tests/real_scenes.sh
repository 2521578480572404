#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# real_scenes.sh WHITTED FOLDER cache|estimate: the promises about real scenes, in counts and errors (never in time; one
# thread, so that every run gives the same). cache: at most 12 % of the shadow rays and 2 % of error at 640x360, 1 sample,
# C_E = 8; 4.5 % and 2.5 % at 320x180, 16 samples, C_E = 32. estimate: from few rays, 320x180, 16 samples, 7 a sample: 1.4 %
# of the pairs and 1.1 % of error; San Miguel within 4 GB. Prints TAP; skips what is not there.
set -u
whitted=$1 folder=$2 part=$3 n=0 bad=0

report() { # STATUS WHAT
    n=$((n + 1))
    if [ "$1" -eq 0 ]; then echo "ok $n - $2"; else echo "not ok $n - $2"; bad=1; fi
}

scene() { # NAME SIZE SPP CE MAX_RAYS MAX_ERROR [OPTION ...]
    local name=$1 size=$2 spp=$3 ce=$4 rays=$5 error=$6 figures what
    shift 6
    what="$name $size, $spp spp, C_E $ce $*"
    if [ ! -f "$folder/$name/$name.glb" ]; then
        n=$((n + 1)); echo "ok $n - $what # SKIP no $folder/$name/$name.glb"
        return
    fi
    figures=$("$whitted" "$folder/$name/$name.glb" --size "$size" --spp "$spp" --ce "$ce" --threads 1 --compare --quiet --json - "$@" |
        python3 -c 'import json, sys
j = json.load(sys.stdin)
traced, error = j["mode_run"]["rays_traced"] / j["mode_run"]["rays_asked"], j["error"]["l_inf"]
print("%.2f %% of the rays, l_inf %.2f %%" % (100 * traced, 100 * error))
sys.exit(not (traced <= float(sys.argv[1]) and error <= float(sys.argv[2])))' "$rays" "$error")
    report $? "$what: $figures"
}

[ "$part" = cache ] && for setting in "640x360 1 8 0.12 0.02" "320x180 16 32 0.045 0.025"; do
    for name in kitchen conference breakfast; do
        scene $name $setting
    done
    scene living-room $setting --env "$folder/hdri/living-room-sky.exr"
done

if [ "$part" = estimate ]; then
    for name in kitchen conference breakfast; do
        scene $name 320x180 16 12 0.014 0.011 --visibility estimate --select 7
    done
    scene living-room 320x180 16 12 0.014 0.011 --visibility estimate --select 7 --env "$folder/hdri/living-room-sky.exr"

    # address space is more than memory: a stricter limit than the promise
    glb=$folder/san-miguel/san-miguel.glb
    if [ -f "$glb" ]; then
        (ulimit -v $((4 * 1024 * 1024)) && exec "$whitted" "$glb" --env "$folder/hdri/kloppenheim_05_1k.hdr" --camera 4 \
            --size 160x90 --compare --quiet --json -) >/dev/null
        report $? "san-miguel within 4 GB of address space"
    else
        n=$((n + 1)); echo "ok $n - san-miguel # SKIP no $glb"
    fi
fi
echo "1..$n"
exit $bad
