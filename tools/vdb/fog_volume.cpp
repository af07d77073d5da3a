#include "stream/vdb/fog_volume.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <optional>

#include "tools/vdb/vdb_plugin.h"

namespace curvisplat {
namespace {

class VdbFogVolume final : public FogVolume {
 public:
  VdbFogVolume(const glm::dvec3& origin, double side) {
    initializeOpenVdb();
    value_ = makeVdbGrid<openvdb::FloatGrid>(0.0f);
    density_ = makeVdbGrid<openvdb::FloatGrid>(0.0f);
    value_->setName("value");
    density_->setName("density");
    density_->setGridClass(openvdb::GRID_FOG_VOLUME);
    const auto transform = openvdb::math::Transform::createLinearTransform(side);
    transform->postTranslate({origin.x, origin.y, origin.z});
    value_->setTransform(transform);
    density_->setTransform(transform->copy());
    values_.emplace(value_->getAccessor());
    densities_.emplace(density_->getAccessor());
  }

  void set(const std::array<uint32_t, 3>& voxel, float value, float density) override {
    const openvdb::Coord at(static_cast<int>(voxel[0]), static_cast<int>(voxel[1]),
                            static_cast<int>(voxel[2]));
    values_->setValue(at, value);
    densities_->setValue(at, density);
  }

  uint64_t bytes() const override { return value_->memUsage() + density_->memUsage(); }
  uint64_t activeVoxels() const override { return density_->activeVoxelCount(); }

  void describe(const std::string& scalar, const std::string& unit, double time) override {
    value_->insertMeta("scalar", openvdb::StringMetadata(scalar));
    value_->insertMeta("unit", openvdb::StringMetadata(unit));
    value_->insertMeta("time", openvdb::DoubleMetadata(time));
  }

  void write(std::ostream& file) const override {
    openvdb::io::Stream stream(file);
    stream.setCompression(openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK);
    stream.write(openvdb::GridPtrVec{density_, value_});
  }

 private:
  openvdb::FloatGrid::Ptr value_, density_;
  std::optional<openvdb::FloatGrid::Accessor> values_, densities_;
};

}  // namespace

std::unique_ptr<FogVolume> vdb_plugin::makeFogVolume(const glm::dvec3& origin, double side) {
  return std::make_unique<VdbFogVolume>(origin, side);
}

}  // namespace curvisplat
