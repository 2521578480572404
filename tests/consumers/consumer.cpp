// SPDX-License-Identifier: Apache-2.0
// A host in C++17: a light set asked for twice. Prints the library's version.
#include <cstdint>
#include <cstdio>
#include <halton/halton.h>
#include <memory>
#include <vcache/vcache.h>
#include <vector>

struct release {
    void operator()(vcache *p) const { vcache_destroy(&p); }
    void operator()(vcache_worker *p) const { vcache_worker_destroy(&p); }
    void operator()(vcache_light_set *p) const { vcache_light_set_destroy(&p); }
};

int main()
{
    vcache_config config = vcache_default_config();
    vcache *cache = nullptr;
    vcache_worker *worker = nullptr;
    vcache_light_set *set = nullptr;
    if (vcache_create(&config, &cache, nullptr) != VCACHE_OK)
        return 1;
    std::unique_ptr<vcache, release> own_cache(cache);
    if (vcache_worker_create(cache, nullptr, &worker, nullptr) != VCACHE_OK)
        return 1;
    std::unique_ptr<vcache_worker, release> own_worker(worker);

    constexpr std::uint32_t count = 40;
    std::vector<std::uint64_t> memory(count * vcache_light_size() / 8), visible(1);
    auto *lights = reinterpret_cast<vcache_light *>(memory.data());
    for (std::uint32_t i = 0; i < count; i++) {
        const float p[3] = {0.02f * float(i), 0.5f, 1.0f};
        vcache_prepare_point(cache, p, i, vcache_light_at(lights, i));
    }
    if (vcache_light_set_create(cache, lights, count, 1 << 16, &set, nullptr) != VCACHE_OK)
        return 1;
    std::unique_ptr<vcache_light_set, release> own_set(set);

    alignas(8) unsigned char eye_memory[VCACHE_EYE_BYTES];
    auto *eye = reinterpret_cast<vcache_eye *>(eye_memory);
    const vcache_surface floor = {{0.1f, 0.2f, 0.0f}, {0.0f, 0.0f, 1.0f}, 1e4f, 0};
    vcache_prepare_eye(cache, &floor, 4.0f, 0, eye);
    std::size_t rays = 0;
    auto trace = [](void *context, const vcache_miss *misses, std::size_t n, vcache_answer *answers) {
        *static_cast<std::size_t *>(context) += n;
        for (std::size_t i = 0; i < n; i++)
            answers[i] = misses[i].light_user % 2 ? VCACHE_VISIBLE : VCACHE_BLOCKED;
        return true;
    };
    for (int i = 0; i < 2; i++) {
        vcache_add_set(worker, eye, set, 0, nullptr, visible.data());
        vcache_resolve(worker, trace, &rays);
    }
    if (rays != count || visible[0] != 0xaaaaaaaaaau || halton_morton(0, 1) != 2)
        return 2;
    const unsigned version = vcache_version();
    std::printf("%u.%u.%u\n", version / 10000, version / 100 % 100, version % 100);
    return 0;
}
