// SPDX-License-Identifier: Apache-2.0
// A host in C++17: handles that release themselves, and a callback that is a lambda. Rows of pixels ask at once.
#include "host.h"
#include <memory>
#include <stdexcept>
#include <vector>

struct release {
    void operator()(vcache *p) const
    {
        vcache_destroy(&p);
    }
    void operator()(vcache_worker *p) const
    {
        vcache_worker_destroy(&p);
    }
};

class visibility
{
  public:
    visibility(const vcache_config &config, bool exact)
    {
        char message[VCACHE_MESSAGE_BYTES];
        vcache *cache = nullptr;
        if (vcache_create(&config, &cache, message) != VCACHE_OK)
            throw std::invalid_argument(message);
        cache_.reset(cache);
        vcache_worker_config worker_config = vcache_default_worker_config();
        worker_config.exact = exact;
        vcache_worker *worker = nullptr;
        if (vcache_worker_create(cache, &worker_config, &worker, message) != VCACHE_OK)
            throw std::invalid_argument(message);
        worker_.reset(worker);
        lamps_.resize(LAMPS * vcache_light_size() / sizeof lamps_[0]);
        for (int i = 0; i < LAMPS; i++) {
            const vec l = lamp_at(i);
            const float position[3] = {l.x, l.y, l.z};
            vcache_prepare_point(cache, position, std::uint64_t(i), vcache_light_at(lamps(), std::size_t(i)));
        }
    }

    // Which of the lamps that bring something are visible; `trace(from, to)` says whether a ray gets through.
    template <class Trace>
    std::vector<bool> ask(const vcache_surface &surface, const std::vector<float> &light, Trace &trace)
    {
        alignas(8) unsigned char memory[VCACHE_EYE_BYTES];
        auto *eye = reinterpret_cast<vcache_eye *>(memory);
        vcache_prepare_eye(cache_.get(), &surface, 8.0f, 0, eye);
        std::uint64_t asked[LAMPS / 64] = {}, visible[LAMPS / 64] = {};
        for (std::size_t i = 0; i < light.size(); i++)
            asked[i / 64] |= std::uint64_t(light[i] > 0.0f) << i % 64;
        // no exception may pass through C: one that could be thrown belongs into the context
        auto call = [](void *context, const vcache_miss *rays, std::size_t count, vcache_answer *answers) {
            for (std::size_t i = 0; i < count; i++)
                answers[i] = (*static_cast<Trace *>(context))(at(rays[i].eye_position), at(rays[i].light_position));
            return true;
        };
        vcache_query(worker_.get(), eye, lamps(), LAMPS, asked, visible, call, &trace);
        std::vector<bool> result(light.size());
        for (std::size_t i = 0; i < light.size(); i++)
            result[i] = asked[i / 64] & visible[i / 64] & std::uint64_t(1) << i % 64;
        return result;
    }

    vcache_statistics statistics() const
    {
        return statistics_of(worker_.get());
    }

  private:
    vcache_light *lamps()
    {
        return reinterpret_cast<vcache_light *>(lamps_.data());
    }
    std::unique_ptr<vcache, release> cache_; // before its worker: released after it
    std::unique_ptr<vcache_worker, release> worker_;
    std::vector<std::uint64_t> lamps_;
};

static std::vector<float> render(visibility &visible)
{
    std::vector<float> image(PIXELS), light(LAMPS);
    auto trace = [](vec from, vec to) { return !occluded(from, to); };
    for (int i = 0; i < PIXELS * SAMPLES; i++) {
        hit h;
        if (!see(i / SAMPLES, i % SAMPLES, 0.0f, &h))
            continue;
        for (int l = 0; l < LAMPS; l++)
            light[std::size_t(l)] = light_of(&h, l);
        const auto seen = visible.ask(surface_of(&h, SAMPLES), light, trace);
        for (std::size_t l = 0; l < light.size(); l++)
            if (seen[l])
                image[std::size_t(i / SAMPLES)] += light[l] / SAMPLES;
    }
    return image;
}

int main()
try {
    make_scene(0.0f);
    visibility cached(config_of_scene(), false), exactly(config_of_scene(), true);
    const auto image = render(cached), exact = render(exactly);
    const auto s = cached.statistics();
    print_figures("", s.asked, s.traced, image_error(image.data(), exact.data(), PIXELS));
} catch (const std::exception &e) {
    std::fprintf(stderr, "host: %s\n", e.what());
    return 1;
}
