// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/core/executor.hpp>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/scene/picture_source.hpp>
#include <compmark/splat/loss/l1.hpp>

#include <cmath>
#include <memory>
#include <vector>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// Four 16 x 12 RGB images, 576 bytes each when decoded.
Dataset four_views(const std::filesystem::path& folder) {
  std::string frames;
  for (int i = 0; i < 4; ++i) {
    put_image(folder / ("train/" + std::to_string(i) + ".png"), 16, 12);
    frames += (i > 0 ? "," : "") + frame_text("train/" + std::to_string(i));
  }
  put(folder / "transforms_train.json", transforms_text(frames));
  Result<Dataset> dataset = open_dataset(folder, {});
  REQUIRE(dataset.ok());
  return *dataset;
}

}  // namespace

TEST_CASE("scene/image: transparent pixels get the background (case CA3)") {
  const std::vector<std::uint8_t> pixels{200, 100, 50, 255, 200, 100, 50, 0, 200, 100, 51, 128};
  std::vector<std::uint8_t> planes(9);
  composite(pixels, 4, {1, 1, 1}, AlphaRounding::truncate, planes);
  CHECK(planes[0] == 200);  // opaque: the colour itself, not one less
  CHECK(planes[3] == 100);
  CHECK(planes[1] == 255);  // transparent: the background, not the stored colour
  CHECK(planes[4] == 255);
  // half: 200 * 128 / 255 + 127 = 227.39; 100 -> 177.196; 51 -> 152.6: truncated, or rounded
  CHECK(planes[2] == 227);
  CHECK(planes[5] == 177);
  CHECK(planes[8] == 152);
  composite(pixels, 4, {1, 1, 1}, AlphaRounding::nearest, planes);
  CHECK(planes[8] == 153);
  composite(pixels, 4, {0, 0.5f, 0}, AlphaRounding::truncate, planes);
  CHECK(planes[1] == 0);
  CHECK(planes[4] == 127);
  // Outside of the silhouette a grey render is pulled to the background; both times alpha, it would not be (control).
  const float render = 0.5f, target = static_cast<float>(planes[1]) / 255, alpha = static_cast<float>(pixels[7]) / 255;
  float pull = 0, masked_pull = 0;
  const float masked_render = render * alpha, masked_target = target * alpha;
  SerialExecutor serial;
  L1Loss<float>::Context context;
  const L1Loss<float> loss;
  loss.forward_backward({&render, 1, 1, 1}, {&target, 1, 1, 1}, 1.0f, {&pull, 1, 1, 1}, context, serial);
  loss.forward_backward({&masked_render, 1, 1, 1}, {&masked_target, 1, 1, 1}, 1.0f, {&masked_pull, 1, 1, 1}, context,
                        serial);
  CHECK(pull == 1);
  CHECK(masked_pull * alpha == 0);
}

TEST_CASE("scene/image: every opaque byte survives compositing, grey fills three planes") {
  for (int value = 0; value < 256; ++value) {
    const std::uint8_t v = static_cast<std::uint8_t>(value);
    const std::array<std::uint8_t, 4> rgba{v, v, v, 255};
    std::array<std::uint8_t, 3> planes{};
    composite(rgba, 4, {0.3f, 0.3f, 0.3f}, AlphaRounding::truncate, planes);
    CHECK(planes == std::array<std::uint8_t, 3>{v, v, v});
    composite(std::span<const std::uint8_t>(rgba).first(1), 1, {0, 0, 0}, AlphaRounding::truncate, planes);
    CHECK(planes == std::array<std::uint8_t, 3>{v, v, v});
  }
}

TEST_CASE("scene/image: floats are value / 255, exactly, and round back to the byte") {
  StoredImage image{256, 1, {}};
  for (int i = 0; i < 768; ++i) image.planes.push_back(static_cast<std::uint8_t>(i % 256));
  std::vector<float> values(768);
  image.to_float({values.data(), 3, 1, 256});
  for (std::size_t i = 0; i < 768; ++i) {
    CHECK(values[i] == static_cast<float>(static_cast<double>(i % 256) / 255.0));
    CHECK(static_cast<std::size_t>(std::lround(values[i] * 255.0f)) == i % 256);
  }
}

TEST_CASE("scene/image_store: decodes once, on demand, into the colours of the file") {
  const TemporaryFolder folder;
  const Dataset dataset = four_views(folder.path());
  ImageStore store(dataset, {});
  CHECK(store.statistics().decoded == 0);
  const Result<const StoredImage*> image = store.get(1);
  REQUIRE(image.ok());
  CHECK((*image)->width == 16);
  CHECK((*image)->height == 12);
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 16; ++x) {
      CHECK((*image)->view()(0, y, x) == 8 * x);
      CHECK((*image)->view()(1, y, x) == 8 * y);
      CHECK((*image)->view()(2, y, x) == 40);
    }
  }
  CHECK(*store.get(dataset.views[1]) == *image);
  CHECK(store.statistics().decoded == 1);
  CHECK(store.statistics().hits == 1);
  std::vector<float> values(3 * 16 * 12);
  CHECK(store.load(dataset.views[1], {values.data(), 3, 12, 16}).ok());
  CHECK(values[1] == 8.0f / 255.0f);
}

TEST_CASE("scene/image_store: the budget evicts the least recently used and changes no pixel") {
  const TemporaryFolder folder;
  const Dataset dataset = four_views(folder.path());
  ImageStore unlimited(dataset, {});
  for (const std::size_t budget : {std::size_t{0}, std::size_t{576}, std::size_t{2 * 576}, std::size_t{3 * 576 + 1}}) {
    CAPTURE(budget);
    ImageStoreSettings settings;
    settings.memory_budget_bytes = budget;
    ImageStore store(dataset, {}, settings);
    for (const std::size_t i : {0u, 1u, 0u, 2u, 3u, 0u, 1u, 1u, 2u}) {
      const Result<const StoredImage*> image = store.get(i);
      REQUIRE(image.ok());
      CHECK((*image)->planes == (*unlimited.get(i))->planes);
      CHECK(store.statistics().bytes <= std::max<std::size_t>(budget, 576));
    }
  }
  ImageStoreSettings two;
  two.memory_budget_bytes = 2 * 576;
  ImageStore store(dataset, {}, two);
  for (const std::size_t i : {0u, 1u, 0u, 2u}) REQUIRE(store.get(i).ok());  // 2 drops 1, as 0 was used later
  CHECK(store.statistics().evicted == 1);
  REQUIRE(store.get(0).ok());
  CHECK(store.statistics().decoded == 3);
  REQUIRE(store.get(1).ok());
  CHECK(store.statistics().decoded == 4);
}

TEST_CASE("scene/image_store: what it delivers has the size of the camera; a file that changed is named") {
  const TemporaryFolder folder;
  Dataset dataset = four_views(folder.path());
  DatasetSettings settings;
  settings.downscale = 4;
  const Result<Dataset> small = open_dataset(folder.path(), settings);
  REQUIRE(small.ok());
  ImageStore store(*small, settings);
  REQUIRE(store.get(0).ok());
  CHECK((*store.get(0))->width == small->views[0].camera.width);
  CHECK((*store.get(0))->height == small->views[0].camera.height);
  CHECK((*store.get(0))->planes.size() == 3 * 4 * 3);

  put_image(folder.path() / "train/2.png", 20, 12);
  ImageStore fresh(dataset, {});
  const Result<const StoredImage*> changed = fresh.get(2);
  REQUIRE(!changed.ok());
  CHECK(names(changed.error(), "2.png", "image size", "put back the image"));
  CHECK(changed.error().problem.find("20 x 12") != std::string::npos);
  CHECK(changed.error().problem.find("16 x 12") != std::string::npos);
  dataset.views[2].file_width = dataset.views[2].file_height = 0;  // not recorded: the proportions decide
  CHECK(!ImageStore(dataset, {}).get(2).ok());
  put_image(folder.path() / "train/2.png", 32, 24);
  CHECK(ImageStore(dataset, {}).get(2).ok());
  std::filesystem::remove(folder.path() / "train/3.png");
  const Result<const StoredImage*> gone = fresh.get(3);
  REQUIRE(!gone.ok());
  CHECK(names(gone.error(), "3.png", "", "check the path"));
  View stranger;
  CHECK(!fresh.get(stranger).ok());
}

TEST_CASE("scene/resize: sizes of the published datasets") {
  // docs/spec/method.md, 3.4; sizes of the originals as published with them.
  CHECK(scaled_size(4032, 3024, 1, 1600) == ImageSize{1600, 1200});
  CHECK(scaled_size(4946, 3286, 1, 1600) == ImageSize{1600, 1063});
  CHECK(scaled_size(3118, 2078, 1, 1600) == ImageSize{1600, 1066});
  CHECK(scaled_size(800, 800, 1, 1600) == ImageSize{800, 800});
  CHECK(scaled_size(4032, 3024, 1, 0) == ImageSize{4032, 3024});
  CHECK(scaled_size(4946, 3286, 8, 1600) == ImageSize{618, 411});  // 618.25 and 410.75
  CHECK(scaled_size(5, 7, 2, 1600) == ImageSize{2, 4});            // halves to even, as Python rounds
  CHECK(scaled_size(3, 3, 64, 1600) == ImageSize{1, 1});
  // Of a factor that would enlarge beyond what image files hold (an int, once), the largest side.
  CHECK(scaled_size(800, 600, 1e-8, 1600) == ImageSize{65536, 65536});
}

TEST_CASE("scene/resize: a constant stays constant, for every value, ratio and filter") {
  for (const ResizeFilter filter : {ResizeFilter::bicubic, ResizeFilter::area}) {
    for (const ImageSize to :
         {ImageSize{5, 3}, ImageSize{17, 11}, ImageSize{1, 1}, ImageSize{16, 12}, ImageSize{40, 30}}) {
      for (const int value : {0, 1, 127, 254, 255}) {
        const std::vector<std::uint8_t> plane(17 * 13, static_cast<std::uint8_t>(value));
        std::vector<std::uint8_t> out(static_cast<std::size_t>(to.width * to.height), 99);
        resize_plane(plane, {17, 13}, out, to, filter);
        for (const std::uint8_t v : out) CHECK(v == value);
      }
    }
  }
}

TEST_CASE("scene/resize: a ramp keeps its slope and its place") {
  // Both filters reproduce a linear function away from the borders: the sample at i of 16 sees input place 4 (i + 1/2) - 1/2.
  std::vector<std::uint8_t> ramp(64);
  for (std::size_t x = 0; x < 64; ++x) ramp[x] = static_cast<std::uint8_t>(10 + 3 * x);
  for (const ResizeFilter filter : {ResizeFilter::bicubic, ResizeFilter::area}) {
    std::vector<std::uint8_t> out(16);
    resize_plane(ramp, {64, 1}, out, {16, 1}, filter);
    for (std::size_t i = 2; i < 14; ++i)
      CHECK(std::abs(out[i] - (10 + 3 * (4 * (static_cast<double>(i) + 0.5) - 0.5))) <= 0.5);
    std::vector<std::uint8_t> column(16);
    resize_plane(ramp, {1, 64}, column, {1, 16}, filter);
    CHECK(column == out);
  }
}

TEST_CASE("scene/resize: the area filter is the mean of the box, the bicubic has Keys' weights") {
  const std::vector<std::uint8_t> plane{10, 20, 30, 41, 0, 100, 200, 100};
  std::vector<std::uint8_t> out(2);
  resize_plane(plane, {4, 2}, out, {2, 1},
               ResizeFilter::area);  // rows first: (15, 36 by rounding) and (50, 150), then columns
  CHECK(out[0] == 33);               // (15 + 50) / 2 = 32.5, halves up
  CHECK(out[1] == 93);               // 35.5 -> 36; (36 + 150) / 2
  // An impulse of 200 halved: by hand, w(x) = 1.5|x|^3 - 2.5|x|^2 + 1 below 1, -0.5|x|^3 + 2.5|x|^2 - 4|x| + 2 below 2, at distances
  // +-0.25, +-0.75, +-1.25, +-1.75: 0.8671875, 0.2265625, -0.0703125, -0.0234375, which sum to 2.
  std::vector<std::uint8_t> impulse(32, 100);
  impulse[16] = 200;
  std::vector<std::uint8_t> half(16);
  resize_plane(impulse, {32, 1}, half, {16, 1}, ResizeFilter::bicubic);
  CHECK(half[8] == 143);  // 100 + 100 * 0.8671875 / 2 = 143.36
  CHECK(half[7] == 111);  // 100 + 100 * 0.2265625 / 2 = 111.33
  CHECK(half[9] == 96);   // 100 - 100 * 0.0703125 / 2 = 96.48
  CHECK(half[6] == 99);   // 100 - 100 * 0.0234375 / 2 = 98.83
  CHECK(half[5] == 100);
}

TEST_CASE("scene/resize: what aliases under point sampling averages out") {
  std::vector<std::uint8_t> stripes(120);
  for (std::size_t x = 0; x < 120; ++x) stripes[x] = x % 2 == 0 ? 0 : 200;
  std::vector<std::uint8_t> out(24);
  resize_plane(stripes, {120, 1}, out, {24, 1});
  for (std::size_t i = 1; i < 23; ++i) CHECK(std::abs(out[i] - 100) <= 5);  // point sampling gives 0 or 200
}

TEST_CASE("scene/image_store: a photograph that decodes to more than the budget is refused before it is decoded") {
  const TemporaryFolder folder;
  put_image(folder.path() / "a.png", 16, 12);
  Dataset dataset;
  dataset.views.push_back({});
  View& view = dataset.views[0];
  view.image_path = folder.path() / "a.png";
  view.camera.width = 16;
  view.camera.height = 12;
  view.file_width = view.file_height =
      16000;  // 768 MB as three bytes a pixel; the file need not be that large to be refused
  ImageStoreSettings settings;
  settings.memory_budget_bytes = std::size_t{700} << 20;
  const Result<const StoredImage*> refused = ImageStore(dataset, {}, settings).get(std::size_t{0});
  REQUIRE(!refused.ok());
  CHECK(names(refused.error(), "a.png", "image size", "--memory-budget"));
  settings.memory_budget_bytes = std::size_t{800} << 20;
  CHECK(ImageStore(dataset, {}, settings).get(std::size_t{0}).error().remedy.find("put back") ==
        0);  // decoded: another size
  settings.memory_budget_bytes = 1;
  view.file_width = 16;
  view.file_height = 12;
  CHECK(ImageStore(dataset, {}, settings).get(std::size_t{0}).ok());  // ordinary photographs always are
  view.camera.width = view.camera.height = 16000;                     // what is delivered counts as well
  const Result<const StoredImage*> enlarged = ImageStore(dataset, {}, settings).get(std::size_t{0});
  REQUIRE(!enlarged.ok());
  CHECK(names(enlarged.error(), "a.png", "downscale", "--memory-budget"));
}

TEST_CASE("scene/image_store: pictures that no file holds are made when they are asked for, and kept") {
  struct Made final : PictureSource {
    mutable int made = 0;
    Result<StoredImage> picture(const View& view, const DecodeSettings& /*settings*/) const override {
      ++made;
      if (view.name == "broken") return Error{ErrorKind::invalid, "source", view.name, "cannot be made", "nothing"};
      StoredImage image{view.camera.width, view.camera.height, {}, {}, {}};
      image.planes.assign(3 * image.plane_size(), static_cast<std::uint8_t>(view.name.size()));
      return image;
    }
  };
  Dataset dataset;
  const auto source = std::make_shared<Made>();
  dataset.pictures = source;
  for (const char* name : {"one", "broken"}) {
    View view;
    view.name = name;
    view.camera.width = 5;
    view.camera.height = 4;
    dataset.views.push_back(view);
  }
  ImageStore store(dataset, {});
  const Result<const StoredImage*> first = store.get(0);
  REQUIRE(first.ok());
  CHECK((*first)->planes == std::vector<std::uint8_t>(60, 3));
  REQUIRE(store.get(0).ok());
  CHECK(source->made == 1);
  CHECK(store.statistics().hits == 1);
  CHECK(store.get(1).error().field == "broken");
}
