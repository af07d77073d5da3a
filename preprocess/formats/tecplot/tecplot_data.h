// The contents of a Tecplot file: variables, and zones with the position of each variable's values. It is the
// result of both readers, of text (tecplot_text.cpp) and of binary files (tecplot_binary.cpp), and the input
// of tecplot_source.cpp. Memory grows with the number of zones and variables, which are limited. One thread reads
// a file; any number may then read values.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/file_index.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The types of values, as binary files number them.
enum class TecplotType : uint8_t { kFloat = 1, kDouble, kInt32, kInt16, kByte };

size_t bytesOf(TecplotType type);

/// The values of one variable in one zone.
struct TecplotValues {
  Centring centring = Centring::kNode;
  bool passive = false;  // the zone has no values of it
  TecplotType type = TecplotType::kFloat;
  bool swap = false;
  bool from_single = false;  // of a text: the numbers have single precision, whatever the type
  std::shared_ptr<const ByteSource> bytes;
  uint64_t begin = 0, stride = 0;  // bytes: of the first value, and from one to the next
  uint64_t row_pitch = 0,
           columns = 0;  // values: from one row of i to the next, and rows from one plane to the next
};

/// Reads the values [first, first + to.size()), in the order of the file. Any number of threads. Needs a
/// buffer of 256 KiB per thread. Throws Error as the bytes do.
template <typename Value>
void readTecplotValues(const TecplotValues& values, uint64_t first, std::span<Value> to);

extern template void readTecplotValues(const TecplotValues&, uint64_t, std::span<float>);
extern template void readTecplotValues(const TecplotValues&, uint64_t, std::span<double>);

/// The faces of polyhedra, or the lines of polygons, which have two corners: of each the number of its corners, or in binary files where
/// they begin; its corners; and the elements on its two sides.
struct TecplotFaces {
  uint64_t count = 0, corner_count = 0;
  uint64_t connected = 0, connections = 0;  // of faces with elements of other zones
  bool has_begins = false;
  TecplotValues sizes, corners, left, right;
};

struct TecplotZone {
  std::string name;
  std::array<uint64_t, 3> nodes{1, 1, 1};
  std::optional<double> time;         // of a zone that belongs to a series; nullopt: it belongs to every step
  std::vector<TecplotValues> values;  // [variable]
  // The cells of a zone of finite elements, which has nodes[0] nodes: tetrahedra, bricks or polyhedra; lines and faces are left out.
  uint64_t elements = 0, element_nodes = 0;  // elements 0: the zone is ordered
  bool of_faces = false;                     // polyhedra or polygons, which have no element_nodes
  TecplotFaces faces;
  TecplotValues connectivity;  // element_nodes numbers of nodes for each
  uint64_t first_node = 0;     // the lowest of these
  std::string flat_elements;   // "FETRIANGLE": they have no volume

  bool ofElements() const { return element_nodes > 0 || of_faces; }
  uint64_t nodeCount() const { return nodes[0] * nodes[1] * nodes[2]; }
  bool flat() const {
    return elements == 0 ? nodes[0] < 2 || nodes[1] < 2 || nodes[2] < 2 : !flat_elements.empty();
  }
  /// "zone 2 (wing)", for messages; `number` from 0.
  std::string describe(size_t number) const;
};

struct TecplotData {
  std::string encoding;  // "ASCII", "binary, version 112, little-endian"
  std::vector<std::string> variables;
  std::vector<TecplotZone> zones;
};

/// Lets zone `to` use the values that zone `from` has of a variable. Throws Error unless `from` precedes it
/// and has its dimensions. `file`: for messages.
void shareTecplotValues(const std::string& file, TecplotData& data, size_t from, size_t to, size_t variable);

/// Throws Error if there are more variables than 65,536, or more than four million in all zones together:
/// each has a place in memory, whatever a damaged file says.
void checkTecplotCounts(const std::string& file, size_t zones, uint64_t variables);

/// The same for the elements of a zone.
void shareTecplotElements(const std::string& file, TecplotData& data, size_t from, size_t to);

/// Sets the nodes of an element of this type of zone ("FEBRICK"), and whether it has a volume. Throws Error if
/// it is unknown.
void setTecplotElements(const std::string& file, TecplotZone& zone, size_t number, const std::string& type);

/// Throws Error if the zone's dimensions are not positive, or if it has more than `most` nodes.
void checkTecplotZone(const std::string& file, const TecplotZone& zone, size_t number, uint64_t most);

/// Whether the file is a text that begins with a record of Tecplot.
bool isTecplotText(const InputFile& file);

/// Reads a text file (.dat, .tec): its headers are parsed at once; its numbers are counted at once, and
/// spooled to `folder` when a zone is first read. Throws Error with the byte.
///
///   TITLE = "jet"
///   VARIABLES = "X" "Y" "Z" "p"
///   ZONE T="inlet", I=3, J=4, K=5, DATAPACKING=BLOCK, VARLOCATION=([4]=CELLCENTERED), SOLUTIONTIME=0.5
///   numbers, separated by white space or commas: 3*1.5 is 1.5 three times
///
/// A zone's values are in blocks (all values of a variable, then those of the next), or by points (all
/// variables of a node). If the header does not say which, they are by points, as in the first Tecplot, or
/// in blocks if some values belong to cells.
///
/// `index`: where numbers are not counted again that it has, and which gets those of this file; null: none.
TecplotData readTecplotText(const std::shared_ptr<const PooledFile>& file,
                            const std::filesystem::path& folder, FileIndex* index = nullptr);

/// Whether the file begins with the signature of a binary file.
bool isTecplotBinary(const InputFile& file);

/// Reads the headers of a binary file (.plt), versions 104 to 113, in either byte order; values are read by
/// position later. Throws Error.
///
///   header                                         numbers: 32 bits; texts: 32 bits a character, ended by 0
///     "#!TDV112", 1 (byte order), file type (from 111), title, variables, their names
///     299.0  a zone: name, parent (from 107), strand, time (64 bits), colour, type, packing (before 112),
///            centring, face neighbours, dimensions, auxiliary data
///     399.0  a geometry; 499.0 a text; 599.0 labels; 699.0 user record; 799.0, 899.0 auxiliary data
///     357.0  its end
///   data, for each zone
///     299.0, types, passive variables, shared variables, connectivity; minimum and maximum of each stored
///     variable; values of each variable (block) or of each node (point); elements and face neighbours; of polyhedra
///     where the corners of each face begin, its corners, the elements on its left and right, and connections
///
/// Values of cells have the rows and columns of the nodes, but not their last plane. Some writers keep that
/// plane, too, and some write the packing in version 112: the variant that fits the file counts.
/// Sources: Tecplot's Data Format Guide, and VisIt's reader for the versions before 112.
TecplotData readTecplotBinary(const std::shared_ptr<const PooledFile>& file);

}  // namespace curvisplat
