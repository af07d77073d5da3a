// Places in the pages of a card: who goes, who stays, and what is kept free for whom.
#include "render/gl/card_places.h"

#include <gtest/gtest.h>

namespace curvisplat {
namespace {

CardPlaces::Item geometry(uint32_t brick) {
  return {brick, false, 0, 0};
}
CardPlaces::Item values(uint32_t brick, uint64_t step, double part = 0) {
  return {brick, true, step, part};
}

TEST(CardPlaces, AreInTheFirstPageWithSpace) {
  CardPlaces places;
  places.addPage(100);
  places.addPage(50);
  EXPECT_EQ(places.put(geometry(1), 80)->page, 0u);
  EXPECT_EQ(places.put(geometry(2), 30)->page, 1u);
  EXPECT_EQ(places.put(values(1, 0), 20)->begin, 80u);
  EXPECT_EQ(places.put(values(1, 0, 0.5), 20)->begin, 30u);
  EXPECT_FALSE(places.put(values(1, 1), 10));
  EXPECT_EQ(places.find(values(1, 0))->page, 0u);
  EXPECT_EQ(places.find(values(1, 1)), nullptr);
}

TEST(CardPlaces, AreGivenUpByWhatWasNotNeededForTheLongestTime) {
  CardPlaces places;
  places.addPage(90);
  for (uint64_t step = 0; step < 3; ++step) {
    places.beginFrame();
    places.put(values(7, step), 30);
  }
  places.beginFrame();
  places.need(values(7, 0));
  EXPECT_FALSE(places.put(geometry(1), 30));
  ASSERT_TRUE(places.removeOldest());
  EXPECT_EQ(places.find(values(7, 1)), nullptr);
  EXPECT_EQ(places.put(geometry(1), 30)->begin, 30u);
  ASSERT_TRUE(places.removeOldest());
  EXPECT_NE(places.find(values(7, 0)), nullptr);
  EXPECT_NE(places.find(geometry(1)), nullptr);
  EXPECT_FALSE(places.removeOldest());  // the rest is needed now
}

TEST(CardPlaces, AreGivenUpByWhatHadALaterPlaceOnceItIsNotNeeded) {
  CardPlaces places;
  places.addPage(90);
  places.beginFrame();
  EXPECT_TRUE(places.keepFor(geometry(1), 30));
  EXPECT_TRUE(places.keepFor(geometry(2), 30));
  places.beginFrame();
  places.put(values(1, 0), 30);
  places.beginFrame();
  places.put(geometry(1), 30);  // is renewed by this
  for (const CardPlaces::Item& item : {geometry(2), values(1, 0)}) {
    ASSERT_TRUE(places.removeOldest());
    EXPECT_EQ(places.find(item), nullptr);
  }
  EXPECT_NE(places.find(geometry(1)), nullptr);
  EXPECT_FALSE(places.removeOldest());
}

TEST(CardPlaces, GoWithTheirPageAlone) {
  CardPlaces places;
  places.addPage(60);
  places.addPage(60);
  places.beginFrame();
  places.put(geometry(1), 60);
  places.put(geometry(2), 30);
  places.removeLastPage();
  EXPECT_EQ(places.pages(), 1u);
  EXPECT_NE(places.find(geometry(1)), nullptr);
  EXPECT_EQ(places.find(geometry(2)), nullptr);
  EXPECT_FALSE(places.put(geometry(2), 30));
  places.beginFrame();
  EXPECT_TRUE(places.removeOldest());
  EXPECT_FALSE(places.removeOldest());
}

TEST(CardPlaces, AreKeptInOrderUntilTheyAreFilled) {
  CardPlaces places;
  places.addPage(100);
  places.addPage(100);
  places.beginFrame();
  EXPECT_TRUE(places.keepFor(geometry(1), 60));
  EXPECT_TRUE(places.keepFor(values(1, 0), 60));
  EXPECT_TRUE(places.keepFor(geometry(2), 40));
  EXPECT_FALSE(places.keepFor(values(2, 0), 1));
  EXPECT_EQ(places.find(geometry(2)), nullptr);
  EXPECT_EQ(places.put(values(3, 0), 40)->begin, 60u);  // behind the first, where nothing is kept
  EXPECT_EQ(places.put(geometry(2), 40)->begin, 60u);
  EXPECT_EQ(places.put(geometry(2), 40)->page, 1u);
  EXPECT_FALSE(places.removeOldest());
  places.beginFrame();
  EXPECT_TRUE(places.removeOldest());
}

}  // namespace
}  // namespace curvisplat
