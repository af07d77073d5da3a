// This file has where bricks lie on the card; card_projection.cpp has how they are projected.
#include "render/gl/card_bricks.h"

#include <algorithm>
#include <functional>
#include <queue>
#include <utility>

#include "render/project/painter_failure.h"
#include "stream/base/error.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

constexpr uint64_t kWordBytes = sizeof(uint32_t), kMinPageBytes = uint64_t{64} << 10;

constexpr uint64_t kSlabs = 8;  // about the most that a picture takes where card memory is short

constexpr uint64_t kSplatWords = sizeof(BrickPieces::Splat) / kWordBytes,
                   kPieceWords = sizeof(StoredPiece) / kWordBytes,
                   kPieceValueWords = sizeof(StoredPieceValues) / kWordBytes;

size_t valueArrays(bool coloured) {
  return kValueArrays * (coloured ? 2 : 1);
}

/// No splat of the part has a later key in any tile. KeyRange::last allows for how splats lean; the rest is for pieces, which
/// may be larger than their splats (BrickStore::canDraw()).
uint64_t lastKeyOfPart(const StoredPart& part) {
  return uint64_t{part.keys.last} + (part.keys.last - part.keys.first) / 4 + 1;
}

size_t splatsOf(const StoredPart& part) {
  size_t sum = 0;
  for (const SplatRange& range : part.ranges) sum += range.size();
  return sum;
}

}  // namespace

CardBricks::CardBricks(const GlFunctions& gl, uint64_t buffer_bytes)
    : gl_(gl),
      largest_(std::min(buffer_bytes, CardBuffer::largest(gl)) / kWordBytes * kWordBytes),
      parts_(gl),
      groups_(gl),
      fates_(gl),
      frames_(gl),
      shading_(gl) {}

void CardBricks::open(uint64_t content, const StepPosition& step) {
  step_ = step;
  if (content == content_) return;
  content_ = content;
  known_.clear();
  places_.clear();
}

bool CardBricks::has(uint32_t brick) const {
  return places_.find(geometryOf(brick)) && places_.find(valuesOf(brick));
}

/// The words of the part's brick, as far as is known.
uint64_t CardBricks::geometryWords(const StoredPart& part) const {
  const uint64_t arrays = kGeometryArrays * part.splats;
  const auto found = known_.find(part.brick);
  if (found == known_.end()) return arrays;
  const Known& known = found->second;
  return arrays + kSplatWords * known.splats.back() + kPieceWords * known.pieces.back();
}

uint64_t CardBricks::valueWords(const StoredPart& part) const {
  const uint64_t arrays = valueArrays(part.coloured) * part.splats;
  const auto found = known_.find(part.brick);
  if (found == known_.end()) return arrays;
  const Known& known = found->second;
  return arrays + known.splats.back() + kPieceValueWords * known.pieces.back();
}

/// elementsOf() without looking for the pieces of its ranges: those of the whole brick, as far as is known.
uint64_t CardBricks::mostElements(const StoredPart& part) const {
  const auto found = known_.find(part.brick);
  return part.elementsASplat() * splatsOf(part) +
         (found == known_.end() ? 0 : part.elementsAPiece() * found->second.pieces.back());
}

CardBricks::Room CardBricks::roomFor(std::span<const StoredPart> parts, uint64_t bytes) const {
  Room room;
  uint64_t full = 0, last = 0;  // bytes of pages, as keepPlaces() fills them
  // What has to be drawn as elements at the same depth, by the last key.
  using Active = std::pair<uint64_t, uint64_t>;
  std::priority_queue<Active, std::vector<Active>, std::greater<>> active;
  uint64_t all = 0, now = 0, most = 0;
  for (const StoredPart& part : parts) {
    for (const uint64_t words : {geometryWords(part), valueWords(part)}) {
      if (words * kWordBytes > largest_) return room;
      if (last + words * kWordBytes > largest_) full += largest_, last = 0;
      last += words * kWordBytes;
    }
    for (; !active.empty() && active.top().first < part.keys.first; active.pop()) now -= active.top().second;
    const uint64_t drawn = sizeof(ScreenSplat) * mostElements(part), pages = full + last;
    active.emplace(lastKeyOfPart(part), drawn);
    all += drawn;
    now += drawn;
    most = std::max(most, now);
    // Slabs share what lies at the depth where one ends, up to `most`. With no more space than that, dozens of them would be
    // needed; so there is more, and fewer bricks where memory is short. A buffer has no more space with fewer bricks.
    const uint64_t slab = std::min(all, most + all / kSlabs);
    // The painter needs a part of the buffer of splats for those that are drawn beside the stored ones.
    if (pages > granted_bytes_ || 2 * most > largest_ || pages + slab > bytes) break;
    room = {room.parts + 1, pages, std::min({all, largest_ / 2, bytes - pages})};
  }
  return room;
}

size_t CardBricks::makeRoom(std::span<const StoredPart> parts, uint64_t bytes, CardBuffer& splats,
                            uint64_t other_bytes) {
  places_.beginFrame();
  for (;;) {
    const Room room = roomFor(parts, bytes);
    const std::span<const StoredPart> fitting = parts.first(room.parts);
    for (const StoredPart& part : fitting) {
      places_.need(geometryOf(part.brick));
      places_.need(valuesOf(part.brick));
    }
    if (!makeSplats(room, bytes, splats, other_bytes) || !makePages(fitting, room)) continue;
    slab_elements_ = room.drawn_bytes / sizeof(ScreenSplat);
    return room.parts;
  }
}

/// Makes `splats` as large as the room needs it, before pages take what is left. It is made smaller only if it leaves the
/// room's pages too little of `bytes`. False if the card refuses memory, of which granted_bytes_ tells afterwards.
bool CardBricks::makeSplats(const Room& room, uint64_t bytes, CardBuffer& splats, uint64_t other_bytes) {
  const auto drawn_bytes = [&] { return splats.bytes() - std::min(splats.bytes(), other_bytes); };
  if (drawn_bytes() > bytes - room.page_bytes) splats.release();
  if (room.parts > 0) {
    try {
      splats.reserve(std::min(room.drawn_bytes + other_bytes, CardBuffer::largest(gl_)));
    } catch (const CardMemoryFailure&) {
      takeAtMost(std::max(room.page_bytes, pageBytes()) / 2);
      return false;
    }
  }
  most_page_bytes_ = std::min(granted_bytes_, bytes - std::min(bytes, drawn_bytes()));
  return true;
}

/// Removes all pages. They have no more bytes from now on, and none if these are few.
void CardBricks::takeAtMost(uint64_t bytes) {
  granted_bytes_ = std::min(granted_bytes_, bytes < kMinPageBytes ? 0 : bytes);
  removePagesBeyond(0);
}

bool CardBricks::giveMemoryUp() {
  const uint64_t bytes = pageBytes();
  takeAtMost(bytes / 2);
  return bytes > 0;
}

/// False if the card refuses memory, of which granted_bytes_ tells afterwards.
bool CardBricks::makePages(std::span<const StoredPart> parts, const Room& room) {
  const uint64_t granted = granted_bytes_;
  const auto grow = [&] {
    while (pageBytes() < room.page_bytes)
      if (!addPage(room.page_bytes - pageBytes())) return false;
    return true;
  };
  if (!is_scattered_) {
    removePagesBeyond(most_page_bytes_);
    if (grow()) return true;
    if (granted_bytes_ < granted) return false;
  }
  is_scattered_ = false;
  removePagesBeyond(0);
  if (!grow()) return false;
  keepPlaces(parts);
  return true;
}

/// Keeps places in the order that roomFor() counts on. What a brick needs that was never put is not known.
void CardBricks::keepPlaces(std::span<const StoredPart> parts) {
  for (const StoredPart& part : parts) {
    if (!known_.contains(part.brick)) continue;
    places_.keepFor(geometryOf(part.brick), geometryWords(part));
    places_.keepFor(valuesOf(part.brick), valueWords(part));
  }
}

/// Adds a page that has room for some of what is wanted, or for more. False if there is no memory for it.
bool CardBricks::addPage(uint64_t wanted_bytes) {
  const uint64_t free = most_page_bytes_ - std::min(most_page_bytes_, pageBytes());
  const uint64_t bytes =
      std::min({largest_, free, std::max(wanted_bytes, most_page_bytes_ / 8)}) / kWordBytes * kWordBytes;
  if (bytes == 0 || bytes < std::min(wanted_bytes, largest_) / kWordBytes * kWordBytes) return false;
  try {
    pages_.emplace_back(gl_).reserve(bytes);
  } catch (const Error&) {
    pages_.pop_back();
    granted_bytes_ = pageBytes() + (bytes > kMinPageBytes ? bytes / 2 : 0);
    most_page_bytes_ = std::min(most_page_bytes_, granted_bytes_);
    return false;
  }
  places_.addPage(bytes / kWordBytes);
  return true;
}

uint64_t CardBricks::pageBytes() const {
  uint64_t sum = 0;
  for (const CardBuffer& page : pages_) sum += page.bytes();
  return sum;
}

/// Removes the last pages, until the others have no more bytes.
void CardBricks::removePagesBeyond(uint64_t bytes) {
  if (bytes == 0) places_.clear();
  while (pageBytes() > bytes) {
    places_.removeLastPage();
    pages_.pop_back();
  }
}

/// A free place, for which pages may be added, and items may go that are not needed.
std::optional<CardPlaces::Place> CardBricks::placeFor(const CardPlaces::Item& item, uint64_t words) {
  for (;;) {
    if (const auto place = places_.put(item, words)) return place;
    if (!addPage(words * kWordBytes) && !places_.removeOldest()) return {};
  }
}

template <typename T>
void CardBricks::write(const CardPlaces::Place& place, uint64_t& at, std::span<const T> some) {
  pages_[place.page].write(at, some);
  at += some.size_bytes();
  sent_bytes_ += some.size_bytes();
}

void CardBricks::put(const StoredPart& part, const GeometryArrays<const float>& geometry,
                     const BrickValues& values, const BrickPieces& pieces) {
  Known& known = known_[part.brick];
  for (size_t octant = 0; octant < known.begins.size(); ++octant) {
    const uint32_t begin = octant > 0 ? known.begins[octant - 1] + part.octant_splats[octant - 1] : 0;
    const auto beyond = std::partition_point(pieces.splats.begin(), pieces.splats.end(),
                                             [&](const auto& splat) { return splat.number < begin; });
    known.begins[octant] = begin;
    known.splats[octant] = static_cast<uint32_t>(beyond - pieces.splats.begin());
    known.pieces[octant] =
        beyond == pieces.splats.end() ? static_cast<uint32_t>(pieces.pieces.size()) : beyond->first;
  }
  if (!places_.find(geometryOf(part.brick))) {
    if (const auto place = placeFor(geometryOf(part.brick), geometryWords(part)))
      putGeometry(*place, geometry, pieces);
    else
      is_scattered_ = true;
  }
  if (!places_.find(valuesOf(part.brick))) {
    if (const auto place = placeFor(valuesOf(part.brick), valueWords(part)))
      putValues(*place, geometry.size(), values, pieces);
    else
      is_scattered_ = true;
  }
}

void CardBricks::putGeometry(const CardPlaces::Place& place, const GeometryArrays<const float>& geometry,
                             const BrickPieces& pieces) {
  const size_t count = geometry.size();
  uint64_t at = place.begin * kWordBytes;
  for (const float* array :
       {geometry.x, geometry.y, geometry.z, geometry.axis0, geometry.axis1, geometry.axis2, geometry.shear10,
        geometry.shear20, geometry.shear21, geometry.weight})
    write(place, at, std::span(array, count));
  if (pieces.has_too_many)
    write(place, at, std::span<const uint32_t>(std::vector<uint32_t>(count, kNoBorder)));
  else
    write(place, at, std::span(geometry.border_code, count));
  write(place, at, std::span(geometry.growth_code, count));
  write(place, at, std::span(pieces.splats));
  write(place, at, std::span(pieces.pieces));
}

void CardBricks::putValues(const CardPlaces::Place& place, size_t count, const BrickValues& values,
                           const BrickPieces& pieces) {
  uint64_t at = place.begin * kWordBytes;
  const auto add = [&](const VariableArrays<const float>& of) {
    for (const float* array : {of.mean, of.slope0, of.slope1, of.slope2, of.variance})
      write(place, at, std::span(array, count));
  };
  add(values.scalar);
  if (values.colours) add(*values.colours);
  write(place, at, std::span(pieces.drawn_slopes));
  write(place, at, std::span(pieces.values));
}

/// The octant that begins with this splat, or one of several; the number of octants for the splat beyond the last.
size_t CardBricks::octantAt(const Known& known, uint32_t splat) {
  const auto found = std::lower_bound(known.begins.begin(), known.begins.end(), splat);
  CURVISPLAT_CHECK(found != known.begins.end() && *found == splat);
  return static_cast<size_t>(found - known.begins.begin());
}

size_t CardBricks::elementsOf(const StoredPart& part) const {
  const Known& known = known_.at(part.brick);
  size_t pieces = 0;
  for (const SplatRange& range : part.ranges)
    pieces += known.pieces[octantAt(known, range.end)] - known.pieces[octantAt(known, range.begin)];
  return part.elementsASplat() * splatsOf(part) + part.elementsAPiece() * pieces;
}

std::vector<CardSlab> CardBricks::beginFrame(std::span<const StoredPart> parts) {
  fates_.reserve(kFates * sizeof(uint32_t));
  fates_.clear();
  frame_parts_ = parts;
  counted_.assign(parts.size(), 0);
  std::vector<CardSlab> slabs(1);
  for (uint32_t number = 0; number < parts.size(); ++number) {
    const size_t elements = elementsOf(parts[number]);
    if (slabs.back().elements + elements > slab_elements_ && parts[number].keys.first > 0) {
      CardSlab next, &last = slabs.back();
      last.front = parts[number].keys.first - 1;
      for (const uint32_t earlier : last.parts)
        if (lastKeyOfPart(parts[earlier]) > last.front) {
          next.parts.push_back(earlier);
          next.elements += elementsOf(parts[earlier]);
        }
      slabs.push_back(std::move(next));
    }
    slabs.back().parts.push_back(number);
    slabs.back().elements += elements;
  }
  slabs.back().front = kLastKey;
  return slabs;
}

}  // namespace curvisplat
