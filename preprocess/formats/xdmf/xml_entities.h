// Entities that an XML file defines for itself: pugixml skips them.
//
//   <!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" [<!ENTITY HeavyData "run.h5">]>   ...   <DataItem>&HeavyData;:/p</DataItem>
#pragma once

#include <string>
#include <string_view>

namespace curvisplat {

/// The text with references to the entities of its internal DTD replaced; those within comments, too, which says nothing.
/// Character references, the five that XML knows and undefined ones stay. Entities may refer to others, eight deep; the
/// text grows by 1 MiB at most. Throws Error, which begins with `name`, where that does not suffice or an entity is in
/// another file.
std::string withEntities(const std::string& name, std::string text);

}  // namespace curvisplat
