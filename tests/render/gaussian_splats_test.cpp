#include "render/export/gaussian_splats.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "render/export/gaussian_files.h"
#include "stream/base/error.h"
#include "stream/model/kernel.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

TEST(GaussianOpacity, AbsorbsAsMuchAsTheFootprintItStandsFor) {
  for (const double t : {1e-9, 0.01, 0.1, 1.0, 2.0, 3.0, 10.0, 19.9, 20.1, 100.0}) {
    const GaussianOpacity found = gaussianOpacity(t);
    EXPECT_NEAR(found.opacity, 1 - std::exp(-t), 1e-12);
    // ∫ (1 - exp(-t e^(-r²/2))) r dr against area ∫ o e^(-r²/2) r dr = area o.
    double absorbed = 0;
    constexpr double kStep = 1e-4;
    for (double r = 0.5 * kStep; r < 12; r += kStep)
      absorbed += -std::expm1(-t * std::exp(-0.5 * r * r)) * r * kStep;
    EXPECT_NEAR(found.area * found.opacity / absorbed, 1, 1e-6) << t;
  }
}

TEST(GaussianSplat, HasTheShapeOfOurs) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int n = 0; n < 200; ++n) {
    const double a0 = std::exp(3 * number(random)), a1 = std::exp(3 * number(random)),
                 a2 = std::exp(3 * number(random));
    const glm::dmat3 a{a0, a0 * number(random), a0 * number(random), 0, a1, a1 * number(random), 0, 0, a2};
    const GaussianSplat splat = gaussianOf({1, 2, 3}, a, 1e-6, 1);
    EXPECT_NEAR(glm::length(splat.rotation), 1, 1e-6);
    const glm::dmat3 axes = glm::mat3_cast(glm::dquat(splat.rotation));
    glm::dmat3 scaled = axes;
    for (int axis = 0; axis < 3; ++axis)
      scaled[axis] *= static_cast<double>(splat.deviation[axis]) / kKernelSigma;
    const glm::dmat3 found = scaled * glm::transpose(scaled), expected = a * glm::transpose(a);
    const double size = a0 * a0 + a1 * a1 + a2 * a2;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        EXPECT_NEAR(found[column][row], expected[column][row], 4e-6 * size * 4);
  }
}

TEST(GaussianSplat, OfABallHasItsOpticalDepth) {
  // V = 1, S = I: all directions see the same.
  const GaussianSplat splat = gaussianOf({0, 0, 0}, glm::dmat3(1.0), 1, 0.7);
  const double depth = 0.7 / (2 * std::numbers::pi * kKernelSigma * kKernelSigma);
  EXPECT_NEAR(splat.opacity, 1 - std::exp(-depth), 1e-6);
}

TEST(GaussianPicture, OfOneSplatIsItsClosedForm) {
  GaussianSplat splat;
  splat.deviation = {0.2f, 0.2f, 0.2f};
  splat.colour = {1, 0, 0};
  splat.opacity = 0.8f;
  Camera camera;
  camera.position = {0, 0, 5};
  camera.parallel_scale = 1;
  const Image image = drawGaussians(std::span(&splat, 1), camera, {65, 65});
  const double variance = std::pow(0.2 * 32.5, 2) + 0.3;
  for (const int x : {32, 40, 45, 60}) {
    const double alpha = 0.8 * std::exp(-0.5 * (x - 32) * (x - 32) / variance);
    EXPECT_NEAR(image.pixel(x, 32)[1], alpha < 1.0 / 255 ? 1 : 1 - alpha, 1e-4) << x;
    EXPECT_NEAR(image.pixel(x, 32)[0], 1, 1e-6);
  }
}

TEST(GaussianPicture, DrawsTheNearerOneBeforeTheOther) {
  std::vector<GaussianSplat> splats(2);
  for (GaussianSplat& splat : splats) splat.deviation = {0.5f, 0.5f, 0.5f};
  splats[0].colour = {1, 0, 0};
  splats[0].opacity = splats[1].opacity = 0.9f;
  splats[0].position = {0, 0, -1};
  splats[1].colour = {0, 0, 1};
  splats[1].position = {0, 0, 1};
  Camera camera;
  camera.position = {0, 0, 5};
  const Image image = drawGaussians(splats, camera, {33, 33});
  EXPECT_GT(image.pixel(16, 16)[2], 0.9f);
  camera.position = {0, 0, -5};
  EXPECT_GT(drawGaussians(splats, camera, {33, 33}).pixel(16, 16)[0], 0.9f);
}

TEST(GaussianFiles, RefuseOtherEndings) {
  EXPECT_THROW(writeGaussians({}, "out.obj"), UsageError);
}

TEST(GaussianFiles, OfPlyHaveTheirNumbersInTheirPlaces) {
  const TemporaryFolder folder;
  GaussianSplat splat;
  splat.position = {1, 2, 3};
  splat.deviation = {0.5f, 1, 2};
  splat.colour = {0.5f, 1, 0};
  splat.opacity = 0.5f;
  writeGaussians(std::span(&splat, 1), folder / "one.ply");
  const std::string text = bytesOfFile(folder / "one.ply");
  const size_t at = text.find("end_header\n") + 11;
  ASSERT_EQ(text.size(), at + 17 * sizeof(float));
  std::array<float, 17> numbers;
  std::memcpy(numbers.data(), text.data() + at, sizeof numbers);
  const std::array<float, 17> expected{
      1, 2, 3, 0, 0, 0, 0, 1.7724539f, -1.7724539f, 0, std::log(0.5f), 0, std::log(2.0f), 1, 0, 0, 0};
  for (size_t n = 0; n < 17; ++n) EXPECT_NEAR(numbers[n], expected[n], 1e-6) << n;
}

TEST(GaussianFiles, OfSpzHaveEachQuantityOfAllSplatsInBytes) {
  const TemporaryFolder folder;
  std::vector<GaussianSplat> splats(2);
  splats[0].position = {1, 2, 3};
  splats[1].position = {5, 2, 3};
  for (GaussianSplat& splat : splats) {
    splat.deviation = {0.004f, 0.04f, 0.4f};
    splat.rotation = {0.5f, 0.5f, -0.5f, 0.5f};
    splat.colour = {0.5f, 1, 0};
  }
  splats[0].opacity = 4.9f / 255;
  splats[1].opacity = 0.5f;
  writeGaussians(splats, folder / "two.spz");
  std::vector<uint8_t> bytes(1000);
  gzFile file = gzopen((folder / "two.spz").c_str(), "rb");
  bytes.resize(static_cast<size_t>(gzread(file, bytes.data(), static_cast<unsigned>(bytes.size()))));
  gzclose(file);
  ASSERT_EQ(bytes.size(), 16u + 2 * 19);
  const std::vector<uint8_t> header(bytes.begin(), bytes.begin() + 16);
  EXPECT_EQ(header, (std::vector<uint8_t>{0x4e, 0x47, 0x53, 0x50, 2, 0, 0, 0, 2, 0, 0, 0, 0, 12, 0, 0}));
  // 1,000 units wide: 250 units of the file to one of the data. x is -500 and 500, to 1/4096.
  const auto fixed = [&](size_t at) {
    const int bits = bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16;
    return (bits < 1 << 23 ? bits : bits - (1 << 24)) / 4096.0;
  };
  EXPECT_EQ(fixed(16), -500);
  EXPECT_EQ(fixed(16 + 9), 500);
  EXPECT_EQ(fixed(16 + 3), 0);
  EXPECT_EQ(bytes[34], 4) << "rounded down, as viewers round the opacities of other files";
  EXPECT_EQ(bytes[35], 127);
  const double span = 0.5 / 0.28209479177387814 * 0.15;
  EXPECT_EQ(bytes[36], 128);
  EXPECT_EQ(bytes[37], std::lround((0.5 + span) * 255));
  EXPECT_EQ(bytes[38], std::lround((0.5 - span) * 255));
  for (size_t axis = 0; axis < 3; ++axis)
    EXPECT_EQ(bytes[42 + axis], std::lround((std::log(std::pow(10.0, static_cast<double>(axis))) + 10) * 16));
  EXPECT_EQ(bytes[48], std::lround(0.5 * 127.5 + 127.5));
  EXPECT_EQ(bytes[49], std::lround(-0.5 * 127.5 + 127.5));
}

/// The attribute of a .glb, as floats.
std::vector<float> floatsOf(const nlohmann::json& gltf, std::string_view binary, const char* name) {
  const auto& accessor =
      gltf["accessors"][gltf["meshes"][0]["primitives"][0]["attributes"][name].get<size_t>()];
  const auto& view = gltf["bufferViews"][accessor["bufferView"].get<size_t>()];
  std::vector<float> numbers(view["byteLength"].get<size_t>() / sizeof(float));
  std::memcpy(numbers.data(), binary.data() + view["byteOffset"].get<size_t>(),
              view["byteLength"].get<size_t>());
  return numbers;
}

TEST(GaussianFiles, OfGlbHaveTheExtensionsAttributesAndZUpwards) {
  const TemporaryFolder folder;
  std::vector<GaussianSplat> splats(3);
  splats[0].position = {1, 2, 3};
  splats[0].deviation = {0.5f, 1, 2};
  splats[0].colour = {0.5f, 1, 0};
  splats[0].opacity = 0.25f;
  splats[1].position = {-1, 5, 0};
  splats[2].position = {0, 0, 7};
  writeGaussians(splats, folder / "some.glb");
  const std::string text = bytesOfFile(folder / "some.glb");
  std::array<uint32_t, 5> head;
  std::memcpy(head.data(), text.data(), sizeof head);
  EXPECT_EQ(text.substr(0, 4), "glTF");
  EXPECT_EQ(head[1], 2u);
  EXPECT_EQ(head[2], text.size());
  EXPECT_EQ(head[3] % 4, 0u);
  EXPECT_EQ(text.substr(16, 4), "JSON");
  const auto gltf = nlohmann::json::parse(text.substr(20, head[3]));
  EXPECT_EQ(text.substr(20 + head[3] + 4, 4), std::string("BIN\0", 4));
  const std::string_view binary = std::string_view(text).substr(20 + head[3] + 8);
  EXPECT_EQ(gltf["buffers"][0]["byteLength"], binary.size());
  EXPECT_EQ(binary.size(), 3u * 60);

  const auto& primitive = gltf["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 0);
  EXPECT_EQ(primitive["extensions"]["KHR_gaussian_splatting"]["kernel"], "ellipse");
  EXPECT_EQ(gltf["extensionsUsed"][0], "KHR_gaussian_splatting");
  EXPECT_EQ(gltf["accessors"][0]["min"], nlohmann::json({-1, 0, -5}));
  EXPECT_EQ(gltf["accessors"][0]["max"], nlohmann::json({1, 7, 0}));
  EXPECT_EQ(floatsOf(gltf, binary, "POSITION"), (std::vector<float>{1, 3, -2, -1, 0, -5, 0, 7, 0}));
  EXPECT_EQ(floatsOf(gltf, binary, "KHR_gaussian_splatting:OPACITY")[0], 0.25f);
  const auto scale = floatsOf(gltf, binary, "KHR_gaussian_splatting:SCALE");
  EXPECT_EQ((std::vector<float>(scale.begin(), scale.begin() + 3)), (std::vector<float>{0.5f, 1, 2}));
  EXPECT_NEAR(floatsOf(gltf, binary, "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0")[1], 1.7724539f, 1e-6);
  // The splat's third axis, z, points along glTF's y.
  const auto q = floatsOf(gltf, binary, "KHR_gaussian_splatting:ROTATION");
  const glm::vec3 axis = glm::quat(q[3], q[0], q[1], q[2]) * glm::vec3(0, 0, 1);
  EXPECT_NEAR(glm::length(axis - glm::vec3(0, 1, 0)), 0, 1e-6);
}

TEST(GaussianFiles, OfGlbNeedASplat) {
  const TemporaryFolder folder;
  EXPECT_THROW(writeGaussians({}, folder / "none.glb"), Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "none.glb"));
}

}  // namespace
}  // namespace curvisplat
