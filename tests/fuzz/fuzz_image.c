/* SPDX-License-Identifier: Apache-2.0 */
/* Images. The first byte says of which format the rest is. */
#include "fuzz_file.h"

#include "../../renderers/common/image_files.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 2)
        return 0;
    notice_enable(false);
    image i = {0};
    message err = {""};
    bool ok;
    if (data[0] % 2) {
        exr_text texts[] = {{"comments", ""}, {"seed", ""}};
        ok = exr_decode(data + 1, size - 1, data[0] & 2, data[0] & 4 ? texts : NULL, data[0] & 4 ? 2 : 0, &i, &err);
    } else {
        char path[128];
        fuzz_write(data + 1, size - 1, "hdr", path);
        ok = image_load(path, &i, &err);
        unlink(path);
    }
    ENSURE_MESSAGE(ok, &err);
    ENSURE(ok == (i.pixels != NULL) && (!ok || (i.width > 0 && i.height > 0)));
    float sum = 0.0f;
    for (size_t k = 0; ok && k < (size_t)i.width * i.height; k++)
        sum += i.pixels[k].x; /* all of them are there */
    (void)sum;
    image_free(&i);
    return 0;
}
