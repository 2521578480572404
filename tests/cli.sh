#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs whitted as a user would: good and bad command lines, files, signals, full disks. Prints TAP.
# Usage: cli.sh WHITTED. Needs bash, coreutils and, where there is a python3, checks JSON with it.
# shellcheck disable=SC2016,SC2054,SC2059 # commas inside of values, escapes made for printf, a script in quotes
set -u
shopt -s nullglob dotglob

if [[ $# -ne 1 || ! -x $1 ]]; then
    echo "usage: cli.sh WHITTED" >&2
    exit 2
fi
whitted=$(realpath -- "$1") || exit 2
program=$whitted
# shellcheck source-path=SCRIPTDIR
. "$(dirname -- "$0")/tap.sh"

tiny=(--size 32x18 --vpls 16)

# --- files to render ---

le32() {
    local n=$1 i
    for i in 1 2 3 4; do
        printf "\\x$(printf %02x $((n & 255)))"
        n=$((n >> 8))
    done
}

# One triangle (0 0 0), (1 0 0), (0 1 0).
make_glb() {
    local json='{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],'
    json+='"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36}],'
    json+='"bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,"componentType":5126,'
    json+='"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]}'
    while ((${#json} % 4)); do json+=' '; done
    printf glTF
    le32 2
    le32 $((12 + 8 + ${#json} + 8 + 36))
    le32 ${#json}
    printf 'JSON%s' "$json"
    le32 36
    printf 'BIN\0'
    local one=1065353216 # 1.0f
    for word in 0 0 0 $one 0 0 0 $one 0; do le32 "$word"; done
}

make_glb >tri.glb
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >'a tri.obj'
printf '%s\n' ply 'format ascii 1.0' 'element vertex 3' 'property float x' 'property float y' 'property float z' \
    'element face 1' 'property list uchar int vertex_indices' end_header '0 0 0' '1 0 0' '0 1 0' '3 0 1 2' >tri.ply

# --- help ---

# name:kind of every option; kinds are those of bad_values below
options=(size:size spp:one vpls:zero vpl-draw:zero env:text env-rotate:angle env-samples:zero env-lights:zero light-samples:zero camera:zero look:look
    visibility:choice select:positive tolerance:small certainty:share ce:positive ce-delta:float ce-samples:float cn:one cz:one cr:ratio refine:zero
    refine-above:float cache-mb:one shared:flag store:choice hash:choice compare:flag runs:one threads:zero seed:seed output:text
    picture:text reference:text half:flag tiles:flag json:text quiet:flag)

good --help
[[ ! -s stderr ]] || problem "--help writes to standard error"
[[ $(lines stdout) -le 42 ]] || problem "$(lines stdout) lines"
[[ $(<stdout) != *-1* && $(<stdout) != *0,0,0* ]] || problem "a default that says nothing"
listed=
while IFS= read -r line; do
    [[ ${#line} -le 100 ]] || problem "${#line} columns: $line"
    [[ $line =~ ^\ +(-[a-z],\ )?--([a-z-]+) ]] && listed+="${BASH_REMATCH[2]}"$'\n'
done <stdout
expected=$(printf '%s\n' "${options[@]%%:*}" help | sort)
[[ $(printf %s "$listed" | sort) == "$expected" ]] ||
    problem "help and this test differ in: $(printf '%s\n' "$listed" "$expected" | sort | uniq -u | tr '\n' ' ')"
mv stdout help
good cornell -h --spp 4
same stdout help || problem "-h behind other arguments prints something else"
finish "--help lists every option in 42 lines of 100 columns"

# --- bad command lines ---

clean_failure 2 "--nonsense" --nonsense
clean_failure 2 "did you mean '--vpls'" --vlps 4
clean_failure 2 "--spp4" --spp4
clean_failure 2 "'-x'" -x
clean_failure 2 "'-o'" cornell -o
clean_failure 2 "second" cornell second
clean_failure 2 "SCENE" ""
finish "unknown options and stray arguments are refused"

clean_failure 2 "--runs" cornell --runs 2
clean_failure 2 "--ce-delta" cornell --visibility estimate --ce-delta 2
clean_failure 2 "--store" cornell --visibility estimate --ce-samples 64 --store words
clean_failure 2 "--half" cornell --half -o out/x.png
clean_failure 2 "--tiles" cornell --tiles
clean_failure 2 "--picture" cornell --picture out/x.png
clean_failure 2 "twice" cornell -o out/x.png -o out/x.png
clean_failure 2 "twice" cornell -o out/x.png -o ./out/../out/x.png
ln -s out/x.png same.png
clean_failure 2 "twice" cornell -o out/x.png -o same.png
clean_failure 2 "twice" cornell --compare -o out/x.png --picture out/x.png
clean_failure 2 "x.jpg" cornell -o out/a.png -o out/x.jpg
clean_failure 2 "out/x" cornell -o out/x
clean_failure 2 "x.exr" cornell --compare --picture out/x.exr
for look in 0,0,0,0,0,0,50 1,2,3,1,2,3,50 0,0,0,0,0,1,0 0,0,0,0,0,1,180 0,0,0,0,0,1,-5 0,0,0,0,0,0,0 1e30,0,0,0,0,1,50 0,0,0,0,0,-2e12,50; do
    clean_failure 2 "--look" cornell "--look=$look" -o out/x.exr
done
clean_failure 2 "--select does without" cornell --select 4 --visibility exact --store words
clean_failure 2 "--select does without" cornell --select 4 --visibility cache --ce-delta 8
clean_failure 2 "--visibility estimate does without" cornell --select 4 --store words
clean_failure 2 "--tolerance and --certainty need" cornell --tolerance 0.2
clean_failure 2 "--tolerance and --certainty need" cornell --certainty 0.2 --visibility estimate
clean_failure 2 "--select draws lights" cornell --visibility adaptive-cache --select 4
clean_failure 2 "--select draws lights" cornell --select 4 --visibility grid
clean_failure 2 "GNX is none of" cornell --visibility grid=GNX
clean_failure 2 "spacing is 5" cornell --visibility grid=OPT,spacing=5
clean_failure 2 "block=N" cornell --visibility grid=OPT,block=x
clean_failure 2 "must be a square" cornell --visibility grid --spp 3
clean_failure 1 "65535x65535" cornell --size 65535x65535 -o out/x.exr
finish "options that do not fit together are refused"

no_number=("" nan inf 12abc 0x10 1,5)
no_int=("${no_number[@]}" 1.5 4294967297 99999999999999999999)
bad_values() {
    case $1 in
    size) values=("" 0x0 1x0 0x1 99999999x1 1x65536 1x4294967297 640 640x x640 4x4x4 -1x4 nanxinf) ;;
    one) values=("${no_int[@]}" 0 -1) ;;
    zero) values=("${no_int[@]}" -1) ;;
    seed) values=("${no_number[@]}" -1 1.5 1e3 18446744073709551616) ;;
    small) values=("${no_number[@]}" -1 1e999 1001) ;;
    share) values=("${no_number[@]}" -0.1 1.01 1e999) ;;
    float) values=("${no_number[@]}" -1 1e999 20000) ;;
    angle) values=("${no_number[@]}" 1e999 -40000 40000) ;;
    positive) values=("${no_number[@]}" 0 -1 1e-9 1e999 20000) ;;
    ratio) values=("${no_number[@]}" 0 1 -2 1e999 17) ;;
    look) values=("" 1 1,2,3,4,5,6 1,2,3,4,5,6,7,8 1,2,3,4,5,6, 1,2,nan,4,5,6,7 1,2,3,inf,5,6,7 1,2,3,4,5,6,1e39) ;;
    choice) values=("" nonsense 0 EXACT) ;;
    text) values=("") ;;
    esac
}

declare -A tried # kinds; a suite that runs once more (tests/samples.h) tries all values of one option of each alone
for entry in "${options[@]}"; do
    name=${entry%%:*} kind=${entry##*:}
    if [[ $kind == flag ]]; then
        clean_failure 2 "--$name" "--$name=1" cornell
        finish "--$name takes no value"
        continue
    fi
    bad_values "$kind"
    [[ ${VCACHE_TEST_PART-1} -gt 1 && ${tried[$kind]+set} ]] && values=("${values[0]}")
    tried[$kind]=1
    for value in "${values[@]}"; do
        clean_failure 2 "'--$name'" cornell -o out/x.exr "--$name=$value"
        [[ $said == *"bad value"* ]] || problem "refused, but not as a bad value: $value ($said)"
    done
    clean_failure 2 "'--$name' needs a value" cornell "--$name"
    clean_failure 2 "'--$name' needs a value" "--$name" --quiet cornell
    finish "--$name refuses $((${#values[@]} + 2)) bad values"
done
many=()
for i in {1..17}; do many+=(-o "out/$i.png"); done
clean_failure 2 "'-o'" cornell "${many[@]}"
finish "too many outputs are refused"

# --- bad files ---

bad_scene() {
    local file=${1##*/}
    clean_failure 1 "${2-$file}" "$1" "${tiny[@]}" -o out/x.exr -o out/x.png --json out/x.json
}

mkdir folder folder.obj
: >empty.glb
: >empty.obj
: >empty.ply
echo 'this is text' | tee text.glb text.ply >text.xyz
size=$(stat -c %s tri.glb)
for n in 4 12 20 $((size / 2)) $((size - 37)) $((size - 1)); do head -c "$n" tri.glb >"cut$n.glb"; done
printf 'v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >nan.obj
printf 'v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 1\n' >flat.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\n' >faceless.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n' >outside.obj

for file in missing.glb missing.obj missing.ply nofolder/missing.glb folder folder.obj; do bad_scene "$file"; done
bad_scene cornel "did you mean 'cornell'"
bad_scene nothing dominoes
bad_scene $'two\nlines.obj' 'two?lines.obj'
finish "missing scenes and folders are refused"
for file in empty.glb empty.obj empty.ply text.glb text.ply text.xyz; do bad_scene "$file"; done
finish "empty files, text and unknown extensions are refused"
for file in cut*.glb; do bad_scene "$file"; done
finish "truncated GLB files are refused"
for name in nan flat faceless outside; do bad_scene "$name.obj" "$name"; done
finish "OBJ files with NaN, without area, without faces, with wild indices are refused"

if [[ $(id -u) -eq 0 ]]; then
    skip "unreadable files are refused" "root reads everything"
else
    cp tri.glb secret.glb
    chmod 0 secret.glb
    bad_scene secret.glb
    finish "unreadable files are refused"
fi

clean_failure 1 "--camera 99" cornell "${tiny[@]}" --camera 99 -o out/x.exr
finish "cameras that are not there are refused"

echo garbage | tee garbage.hdr >garbage.exr
printf '\x76\x2f\x31\x01\x02\0\0\0' >header.exr
for file in missing.hdr missing.exr garbage.hdr garbage.exr header.exr empty.glb folder; do
    clean_failure 1 "$file" cornell "${tiny[@]}" --env "$file" -o out/x.exr
done
clean_failure 1 "--env-rotate" cornell "${tiny[@]}" --env-rotate 90 -o out/x.exr
finish "environment maps that are missing or damaged are refused, and turning none"

quiet=(cornell "${tiny[@]}" --quiet)
good "${quiet[@]}" -o small.exr
LC_ALL=C sed 's/R\x00\x02\x00\x00\x00/Q\x00\x02\x00\x00\x00/' small.exr >queer.exr
head -c 400 small.exr >short.exr
for file in missing.exr garbage.exr header.exr short.exr empty.glb folder garbage.hdr; do
    clean_failure 1 "$file" "${quiet[@]}" --reference "$file" -o out/x.exr --json out/x.json
done
clean_failure 1 "channels R, G, B" "${quiet[@]}" --reference queer.exr
clean_failure 1 "32x18 pixels, the image 18x32" "${quiet[@]}" --size 18x32 --reference small.exr
# before rendering, and before the scene is read
begin=$(date +%s)
clean_failure 1 small.exr atrium --size 1920x1080 --spp 4096 --reference small.exr
clean_failure 1 small.exr missing.glb --reference small.exr
(($(date +%s) - begin < 10)) || problem "refused after rendering"
rm small.exr
finish "references that are missing, damaged, of other size or channels are refused before rendering"

for option in -o --picture --json; do
    name=x.png
    [[ $option == --json ]] && name=x.json
    clean_failure 1 "nofolder/$name" cornell "${tiny[@]}" --compare "$option" "nofolder/$name"
done
ln -s nofolder/x.png dangling.png
clean_failure 1 "nofolder" cornell "${tiny[@]}" -o dangling.png
mkdir folder.exr folder.png
clean_failure "1 2" "folder.exr" cornell "${tiny[@]}" -o folder.exr
clean_failure "1 2" "folder.png" cornell "${tiny[@]}" --compare --picture folder.png
clean_failure "1 2" "folder" cornell "${tiny[@]}" --json folder
clean_failure "1 2" "/dev/full" cornell "${tiny[@]}" --json /dev/full
[[ -d folder.exr && -c /dev/full ]] || problem "something was written over"
no_temporaries
finish "outputs that cannot be written are refused before rendering"

echo before >out.exr
run cornell "${tiny[@]}" --camera 99 -o out.exr
[[ $(<out.exr) == before ]] || problem "a failed run changed its output file"
finish "a failed run leaves earlier output alone"

# --- good runs ---

for scene in cornell shapes dominoes plant; do
    rm -f x.exr x.png
    quiet_good "$scene" "${tiny[@]}" -o x.exr -o x.png
    is_exr x.exr
    is_png x.png
    good "$scene" "${tiny[@]}"
    [[ $(head -n 1 stdout) == "$scene: "*" triangles, 32x18, 1 spp, 16 virtual point lights"* ]] ||
        problem "no table on standard output"
    finish "$scene renders to EXR and PNG"
done
quiet_good --size 16x9 --vpls 4 -o atrium.exr --json atrium.json
is_exr atrium.exr
read_json atrium.json
figure_is scene '"atrium"'
finish "atrium is the default and renders"

for file in 'a tri.obj' tri.ply tri.glb; do
    good "$file" "${tiny[@]}" -o 'out/a file.png'
    is_png 'out/a file.png'
    rm -f out/*
    [[ $(<stdout) == *": 1 triangle, "* ]] || problem "1 triangles"
    [[ $said == *"notice: $file: no camera"* && $said == *"notice: $file: no light"* ]] ||
        problem "no notices: $file ($said)"
    quiet_good "$file" "${tiny[@]}" -o out/x.exr
    is_exr out/x.exr
    rm -f out/*
done
finish "OBJ, PLY and GLB without camera and light render, with notices"

for intensity in 0 1 1e38; do
    lamp_gltf $intensity 0,0,0 >lamp.gltf
    good lamp.gltf "${tiny[@]}" --vpls 16
    case $intensity in
        0) [[ $said == *"all lights have intensity 0"* ]] ;;
        1) [[ $said != *"intensity 0"* && $said != *"floats"* ]] ;;
        1e38) [[ $said == *"no virtual point lights: "*"floats"* ]] ;;
    esac || problem "intensity $intensity: $said"
done
finish "lights that are all off, or too bright for floats, are said"

mkdir pipes
mkfifo pipes/a.mtl
printf '%s\n' 'mtllib a.mtl' 'v 0 0 0' 'v 1 0 0' 'v 0 1 0' 'f 1 2 3' >pipes/a.obj
good pipes/a.obj "${tiny[@]}"
[[ $said == *"notice: pipes/a.obj: pipes/a.mtl: not a regular file|"* ]] || problem "no notice ($said)"
sed -E 's/"uri":"[^"]*"/"uri":"a.mtl"/' lamp.gltf >pipes/a.gltf
clean_failure 1 a.mtl pipes/a.gltf "${tiny[@]}" --quiet
finish "named pipes that a scene names are not waited for"

for ke in 1e30 1e37; do
    printf 'newmtl lamp\nKd 0 0 0\nKe %s %s %s\nnewmtl wall\nKd 0.5 0.5 0.5\n' $ke $ke $ke >bright.mtl
    printf '%s\n' 'mtllib bright.mtl' 'v -1 0 -1' 'v 1 0 -1' 'v 1 0 1' 'v -1 0 1' 'v -1 2 -1' 'v 1 2 -1' 'v 1 2 1' \
        'v -1 2 1' 'usemtl wall' 'f 4 3 2 1' 'usemtl lamp' 'f 5 6 7 8' >bright.obj
    run bright.obj --size 16x16 --vpls 4 --spp 1 --look 0,1,3,0,0,0,60 -o bright.exr
    [[ $rc -eq 0 ]] || problem "Ke $ke: exit $rc ($said)"
    [[ $ke == 1e37 && $said == *"pixels are infinite or no number"* || $ke == 1e30 && $said != *infinite* ]] ||
        problem "Ke $ke: $said"
done
finish "light that floats cannot hold is said"

good cornell "${tiny[@]}" --visibility grid
[[ $said == *"notice: --visibility grid decides directional lights, and there is none"* ]] || problem "no notice: $said"
finish "a grid with nothing to decide says so"

quiet_good cornell "${tiny[@]}" --output=float.exr -o tiles.exr --tiles
is_exr tiles.exr 02020000
quiet_good cornell "${tiny[@]}" -o float.exr
quiet_good cornell "${tiny[@]}" -o half.exr --half
quiet_good cornell "${tiny[@]}" -o both.EXR --half --tiles
mv both.EXR both.exr
is_exr float.exr
is_exr half.exr
is_exr both.exr 02020000
[[ $(stat -c %s half.exr) -lt $(stat -c %s float.exr) ]] || problem "half is not smaller than float"
for file in float tiles half both; do quiet_good cornell "${tiny[@]}" --env "$file.exr"; done
finish "--half and --tiles write EXR files that can be read again"

shown=(--size 48x27 --vpls 32 --spp 1) # atrium has light that is not shadow-tested
quiet_good "${shown[@]}" --visibility exact -o shown.exr
quiet_good "${shown[@]}" --visibility cache --compare --reference shown.exr --json shown.json
read_json shown.json
figure_is reference.mode_run.flip "${figure[error.flip]}"
[[ ${figure[error.flip]} != 0 ]] || problem "nothing differs"
finish "--reference shows an image as it was made"

sky=(cornell "${tiny[@]}" --env float.exr --env-lights 9)
quiet_good "${sky[@]}" -o sky.exr --json sky.json
for degrees in 0 90 360; do
    quiet_good "${sky[@]}" --env-rotate $degrees --reference sky.exr --json sky.json
    read_json sky.json
    figure_is env_rotate $degrees
    figure_is punctual_lights 9
    [[ $degrees == 90 ]] || figure_is reference.mode_run.l_inf 0
    [[ $degrees != 90 || ${figure[reference.mode_run.l_inf]} != 0 ]] || problem "a quarter turn changes nothing"
done
finish "--env-rotate turns the environment"

quiet_good cornell "${tiny[@]}" -o twice.png
quiet_good cornell "${tiny[@]}" -o twice.png --look 0,1,4,0,1,0,40
is_png twice.png
good --quiet --size 4x4 --vpls 4 -- cornell
quiet_good cornell "${tiny[@]}" --size 1x1 --vpls 0 --light-samples 0 --env-samples 0 -o twice.png -o twice.exr
no_temporaries
finish "small things: one pixel, no lights asked for, --look, --, output over older output"

# --- figures ---

always=(scene triangles width height spp lights threads seed mode ce env_samples light_samples store
    mode_run.frame_s mode_run.shade_s mode_run.rays_asked mode_run.rays_traced mode_run.cache_bytes)
compared=(exact.frame_s exact.shade_s exact.rays error.l_inf error.rel_mse error.p999 error.max error.mispredicted
    speedup.frame speedup.shade speedup.rays)

quiet_good cornell "${tiny[@]}" --json plain.json --seed 18446744073709551615 --threads 1
read_json plain.json
has_keys "${always[@]}"
for pair in 'scene "cornell"' 'width 32' 'height 18' 'spp 1' 'vpls 16' 'threads 1' 'seed 18446744073709551615' \
    'mode "cache"' 'ce 8' 'complete true'; do
    figure_is "${pair% *}" "${pair#* }"
done
[[ ! ${figure[error.l_inf]+set} ]] || problem "errors without --compare"
good cornell "${tiny[@]}" --json - --seed 18446744073709551615 --threads 1
mv stdout standard.json
[[ $said == *"cornell: "* ]] || problem "no table on standard error beside --json -"
steady=$(steady_figures)
read_json standard.json
[[ $(steady_figures) == "$steady" ]] || problem "--json - says something else than --json FILE"
finish "--json writes to a file and to standard output"

quiet_good cornell "${tiny[@]}" --compare --json compare.json --picture picture.png -o error.exr
is_png picture.png
is_exr error.exr
read_json compare.json
has_keys "${always[@]}" "${compared[@]}"
figure_is exact.rays "${figure[mode_run.rays_asked]-}"
((${figure[mode_run.rays_traced]:-0} > 0 && ${figure[mode_run.rays_traced]:-0} < ${figure[mode_run.rays_asked]:-0})) ||
    problem "the cache saves nothing: ${figure[mode_run.rays_traced]-} of ${figure[mode_run.rays_asked]-}"
good cornell "${tiny[@]}" --compare
[[ $(lines stdout) -eq 5 && $(<stdout) == *speed-up*l_inf* ]] || problem "no table of five lines"
finish "--compare gives all figures and a picture"

quiet_good cornell "${tiny[@]}" --compare --visibility exact --json exact.json
read_json exact.json
figure_is mode '"exact"'
for key in l_inf rel_mse p999 max mispredicted; do figure_is "error.$key" 0; done
figure_is mode_run.rays_traced "${figure[mode_run.rays_asked]-}"
figure_is exact.rays "${figure[mode_run.rays_asked]-}"
figure_is speedup.rays 1
finish "exact visibility does not differ from exact visibility"

# --- lights drawn ---

for pair in ':estimate' '--visibility=estimate:estimate' '--visibility=exact:selection' \
    '--visibility=cache:cached-selection'; do
    quiet_good cornell "${tiny[@]}" --vpls 200 --select 3 ${pair%%:*} --compare --json drawn.json
    read_json drawn.json
    figure_is mode "\"${pair#*:}\""
    figure_is served "\"${pair#*:}\""
    figure_is select 3
    ((${figure[mode_run.rays_traced]:-0} < ${figure[exact.rays]:-0} / 10)) || problem "$pair: many rays"
done
quiet_good cornell "${tiny[@]}" --vpls 10 --select 3 --visibility exact --compare --json drawn.json
read_json drawn.json
figure_is served '"exact"'
figure_is error.l_inf 0
finish "lights are drawn in three ways"

for vpls in 16 0; do
    quiet_good cornell "${tiny[@]}" --spp 4 --visibility exact --vpls $vpls -o draw.exr
    quiet_good cornell "${tiny[@]}" --spp 4 --visibility exact --vpls $vpls --vpl-draw 1 --reference draw.exr --json draw.json
    read_json draw.json
    figure_is vpl_draw 1
    [[ $vpls != 0 ]] || figure_is reference.mode_run.l_inf 0
    [[ $vpls == 0 || ${figure[reference.mode_run.l_inf]} != 0 ]] || problem "another draw has the same lights"
done
finish "--vpl-draw makes other virtual point lights and nothing else"

for pair in adaptive:adaptive adaptive-cache:adaptive-cache; do
    quiet_good conference-lights --size 48x32 --vpls 0 --visibility "${pair%:*}" --tolerance 0.2 --certainty 0.25 --compare \
        --json adaptive.json -o adaptive.exr
    read_json adaptive.json
    has_keys "${compared[@]}" error.mean_relative error.max_relative
    figure_is mode "\"${pair#*:}\""
    figure_is served "\"${pair#*:}\""
    figure_is tolerance 0.2
    figure_is certainty 0.25
    ((${figure[mode_run.rays_traced]:-0} < ${figure[exact.rays]:-0} / 2)) || problem "$pair: many rays"
done
good conference-lights-7-diffuse --size 8x8 --vpls 0 --visibility adaptive --tolerance 0 --compare
[[ $(<stdout) == *", 7 punctual lights"*$'\n'"adaptive: all "*" l_inf 0.000 %"* ]] || problem "no table of t = 0: $(<stdout)"
good conference-lights --size 8x8 --vpls 0 --visibility adaptive --certainty 0 --shared
[[ $(<stdout) == *$'\n'"adaptive 0.1 0 "* ]] || problem "no row of t = 0.1, c = 0: $(<stdout)"
bad_scene conference-lights-0 "did you mean"
bad_scene conference-lights-65537 built-in
bad_scene conference-lights-24-sinking built-in
finish "adaptive shadow testing"

quiet_good cornell "${tiny[@]}" --compare --runs 2 --json runs.json
read_json runs.json
figure_is runs 2
has_keys "${compared[@]}"
finish "--runs 2"

quiet_good cornell "${tiny[@]}" --size 192x160 --threads 2 --json own.json
read_json own.json
own=${figure[mode_run.cache_bytes]:-0}
quiet_good cornell "${tiny[@]}" --size 192x160 --threads 2 --shared --json shared.json
read_json shared.json
[[ $own -gt 0 && $((2 * ${figure[mode_run.cache_bytes]:-0})) -eq $own ]] ||
    problem "shared: ${figure[mode_run.cache_bytes]-} bytes, one per thread: $own"
finish "--shared uses one cache"

one=(cornell "${tiny[@]}" --threads 1 --spp 2)
errors=(l_inf rel_mse p999 max)
quiet_good "${one[@]}" -o mode.exr
quiet_good "${one[@]}" --reference mode.exr --json self.json
read_json self.json
figure_is reference.file '"mode.exr"'
for key in "${errors[@]}"; do figure_is "reference.mode_run.$key" 0; done
[[ ! ${figure[reference.exact.l_inf]+set} ]] || problem "an error of an exact frame that was not rendered"
quiet_good "${one[@]}" --reference mode.exr --seed 1 --json other.json
read_json other.json
for key in "${errors[@]}"; do
    [[ ${figure[reference.mode_run.$key]-0} =~ ^[0-9.e-]*[1-9] ]] || problem "another seed makes no $key"
done
quiet_good "${one[@]}" --reference mode.exr --compare --json both.json
read_json both.json
figure_is reference.mode_run.l_inf 0
# the same two images, but for the part of them that is the reference
[[ ${figure[reference.exact.l_inf]-0} != 0 && ${figure[error.l_inf_whole]-0} != 0 ]] || problem "exact is not measured"
good "${one[@]}" --reference mode.exr
[[ $(lines stdout) -eq 3 && $(tail -n 1 stdout) == "reference "*" cache C_E 8: l_inf 0.000 %   relMSE 0 "* &&
    ! -s stderr ]] || problem "no line of the reference: $(tail -n 1 stdout)"
good "${one[@]}" --reference mode.exr --compare
[[ $(lines stdout) -eq 6 && $(tail -n 1 stdout) == "reference "*" exact: l_inf "*" cache C_E 8: l_inf 0.000 %"* ]] ||
    problem "no line of both frames: $(tail -n 1 stdout)"
quiet_good "${one[@]}" --json none.json
read_json none.json
[[ ! ${figure[reference.file]+set} ]] || problem "a reference that was not given"
finish "--reference gives the error of each frame against a file"

for hash in split lcg-pair lcg-xorshift; do
    quiet_good cornell "${tiny[@]}" --hash "$hash" --compare --json hash.json
    read_json hash.json
    has_keys "${compared[@]}"
done
quiet_good cornell "${tiny[@]}" --spp 2 --ce 4 --ce-delta 2 --ce-samples 3 --cn 4 --cz 4 --cr 1.5 --refine 1 --cache-mb 1 \
    --json settings.json
read_json settings.json
for pair in 'ce 4' 'ce_delta 2' 'ce_samples 3' 'spp 2' 'cn 4' 'cz 4' 'cr 1.5' 'refine 1' 'cache_mb 1' 'hash "split"' \
    'shared false'; do
    figure_is "${pair% *}" "${pair#* }"
done
finish "every hash and every setting of the cache"

# EXR and PNG carry times as text. Their pixels are in the second half of an EXR file; pictures carry no text.
pixels() { tail -c "$pixel_bytes" "$1"; }
for i in 1 2 3; do
    seed=5
    [[ $i -eq 3 ]] && seed=6
    quiet_good cornell "${tiny[@]}" --threads 1 --seed $seed --compare --json "run$i.json" --picture "run$i.png" -o "run$i.exr"
    read_json "run$i.json"
    steady_figures >"run$i.txt"
done
pixel_bytes=$(($(stat -c %s run1.exr) / 2))
same run1.txt run2.txt || problem "figures differ between two runs"
same run1.png run2.png || problem "pictures differ between two runs"
same <(pixels run1.exr) <(pixels run2.exr) || problem "pixels differ between two runs"
same run1.txt run3.txt && problem "figures do not depend on the seed"
same run1.png run3.png && problem "the picture does not depend on the seed"
same <(pixels run1.exr) <(pixels run3.exr) && problem "pixels do not depend on the seed"
finish "one thread and one seed give one image"

# --- signals ---

if ! env --default-signal=INT true 2>/dev/null; then
    skip "interrupts" "this env cannot reset signals"
else
    mkdir signal
    # many small tiles
    "$whitted" cornell --size 1280x720 --vpls 0 --quiet -o large.exr
    start cornell --size 1280x720 --spp 2 --threads 1 --reference large.exr -o signal/x.exr -o signal/x.png --json signal/x.json --quiet
    kill -INT "$child"
    reap
    [[ $rc -eq 130 ]] || problem "exit $rc instead of 130 ($said)"
    [[ ! -s stdout && ! -s stderr ]] || problem "--quiet is not quiet ($said)"
    ((waited < 10000)) || problem "took $waited ms"
    no_temporaries signal
    is_exr signal/x.exr
    is_png signal/x.png
    read_json signal/x.json
    figure_is complete false
    [[ ! ${figure[reference.mode_run.l_inf]+set} ]] || problem "half a frame is compared with the reference"
    quiet_good cornell "${tiny[@]}" --env signal/x.exr
    finish "SIGINT ends rendering and what is done is written"

    # one tile that takes minutes
    start cornell --size 32x32 --spp 512 --vpls 2048 --compare --runs 2 --threads 1 -o out/x.exr --json out/x.json
    kill -TERM "$child"
    reap
    [[ $rc -eq 143 && $said == "notice: interrupted: "* ]] || problem "exit $rc instead of 143 ($said)"
    ((waited < 2000)) || problem "took $waited ms"
    is_exr out/x.exr
    read_json out/x.json
    figure_is complete false
    [[ ! ${figure[speedup.frame]+set} && ! ${figure[error.l_inf]+set} ]] || problem "half a frame is compared"
    [[ $(lines stdout) -eq 2 && $(<stdout) == *"(interrupted)" ]] || problem "the table is of a whole frame"
    finish "SIGTERM within a tile of a comparison compares nothing"
    rm -rf out && mkdir out

    # within the small pair that warms up: what comes then would be black
    start cornell --size 32x32 --spp 512 --vpls 8192 --compare --threads 1 -o out/x.exr --json out/x.json
    kill -TERM "$child"
    reap
    [[ $rc -eq 143 && $said == "notice: interrupted before the first pixel: nothing is written|" ]] ||
        problem "exit $rc instead of 143 ($said)"
    [[ ! -s stdout ]] || problem "a table of nothing"
    nothing_left "before the first pixel"
    finish "SIGTERM before the first pixel writes nothing"
    interrupt_loading
fi

# --- no space ---

if [[ -c /dev/full ]]; then
    for arguments in "cornell --json - --quiet" cornell --help; do
        # shellcheck disable=SC2086
        timeout 60 "$whitted" $arguments "${tiny[@]}" >/dev/full 2>stderr
        rc=$?
        said=$(tail -n 1 stderr)
        [[ $rc -eq 1 && $said == "whitted: standard output: "* ]] || problem "exit $rc: $arguments ($said)"
    done
    finish "a full disk behind standard output is noticed"
else
    skip "a full disk behind standard output is noticed" "no /dev/full"
fi

# no_space OPTION FILE: checks a run whose messages are in said
no_space() {
    [[ $rc -eq 1 && $said == "whitted: "*"$2: "* && $said != *$'\n'* ]] || problem "exit $rc: $1 $2 (${said//$'\n'/|})"
}

spacious=(cornell --size 160x90 --vpls 16 --quiet --compare)
echo before >out/old.png
for option in '-o out/x.exr' '-o out/x.png' '-o out/old.png' '--picture out/x.png' '--json out/x.json'; do
    blocks=1 # of 1024 bytes
    [[ $option == --json* ]] && blocks=0
    said=$(
        ulimit -f $blocks
        exec timeout 60 "$whitted" "${spacious[@]}" "${option% *}" "${option#* }" 2>&1
    )
    rc=$?
    no_space "${option% *}" "${option#* }"
done
[[ $(<out/old.png) == before ]] || problem "the older file is gone"
rm -f out/old.png
nothing_left "beyond the limit"
finish "a limit on file sizes is a failure in one line without half a file"

unshare=(unshare --mount)
[[ $(id -u) -eq 0 ]] || unshare+=(--user --map-root-user)
mount='mount -t tmpfs -o size=4k none "$1"'
if ! "${unshare[@]}" bash -c "$mount" - out 2>/dev/null; then
    skip "a full disk is a failure in one line without half a file" "no tmpfs can be mounted"
else
    for option in '-o x.exr' '-o x.png' '--picture x.png'; do
        said=$("${unshare[@]}" bash -c "$mount"'
            cd "$1" || exit
            shift
            timeout 60 "$@" 2>&1
            rc=$?
            ls -A
            exit "$rc"' - out "$whitted" "${spacious[@]}" "${option% *}" "${option#* }")
        rc=$?
        no_space "${option% *}" "${option#* }"
    done
    finish "a full disk is a failure in one line without half a file"
fi

tap_end
