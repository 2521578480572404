/* SPDX-License-Identifier: Apache-2.0 */
/* Scene files. The first byte says of which format the rest is. */
#include "fuzz_file.h"

#include "../../renderers/common/scene.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const formats[] = {"glb", "gltf", "obj", "ply"};
    if (size < 2)
        return 0;
    notice_enable(false);
    char path[128];
    fuzz_write(data + 1, size - 1, formats[data[0] % 4], path);
    scene *s = NULL;
    message err = {""};
    bool ok = scene_load(path, &s, &err);
    ENSURE(ok == (s != NULL));
    ok = ok && scene_finish(s, &err);
    ENSURE_MESSAGE(ok, &err);
    ENSURE(!ok || (s->triangle_count > 0 && isfinite(s->bounds_min.x) && isfinite(s->bounds_max.x)));
    scene_free(s);
    unlink(path);
    return 0;
}
