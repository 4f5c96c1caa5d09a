// What LightFromPhoto.cs uses of Unity 6, as its scripting reference declares it, so that a compiler checks names and types.
using System;
using System.Collections.Generic;

namespace UnityEngine
{
    public class Object
    {
        public string name;
        public static implicit operator bool(Object o) { return !ReferenceEquals(o, null); }
        public static T[] FindObjectsByType<T>(FindObjectsSortMode sortMode) where T : Object { return null; }
        public static void DestroyImmediate(Object obj) { }
    }
    public enum FindObjectsSortMode { None, InstanceID }
    public class ScriptableObject : Object { public static T CreateInstance<T>() where T : ScriptableObject { return null; } }
    public class Component : Object
    {
        public GameObject gameObject;
        public Transform transform;
        public T GetComponent<T>() { return default(T); }
    }
    public class Behaviour : Component { public bool enabled { get; set; } }
    public class MonoBehaviour : Behaviour { }
    public sealed class GameObject : Object
    {
        public GameObject(string name) { }
        public Transform transform;
        public T AddComponent<T>() where T : Component { return null; }
        public T GetComponent<T>() { return default(T); }
        public static GameObject Find(string name) { return null; }
        public static GameObject CreatePrimitive(PrimitiveType type) { return null; }
    }
    public enum PrimitiveType { Sphere, Capsule, Cylinder, Cube, Plane, Quad }
    public class Transform : Component
    {
        public Vector3 localPosition { get; set; }
        public Vector3 localScale { get; set; }
        public void SetParent(Transform parent) { }
        public void SetParent(Transform parent, bool worldPositionStays) { }
        public void SetPositionAndRotation(Vector3 position, Quaternion rotation) { }
    }
    public struct Vector2 { public float x, y; public Vector2(float x, float y) { this.x = x; this.y = y; } }
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero { get { return default(Vector3); } }
        public static Vector3 one { get { return default(Vector3); } }
        public static Vector3 up { get { return default(Vector3); } }
        public static Vector3 operator *(float d, Vector3 a) { return a; }
    }
    public struct Quaternion { public float x, y, z, w; public static Quaternion identity { get { return default(Quaternion); } } }
    public struct Color
    {
        public float r, g, b, a;
        public Color(float r, float g, float b) { this.r = r; this.g = g; this.b = b; a = 1; }
        public Color gamma { get { return this; } }
        public static Color white { get { return default(Color); } }
        public static Color black { get { return default(Color); } }
    }
    public struct Mathf
    {
        public const float PI = 3.14159274F, Deg2Rad = 0.0174532924F;
        public static float Tan(float f) { return f; }
        public static float Abs(float f) { return f; }
        public static float Log(float f, float p) { return f; }
    }
    public static class Debug
    {
        public static void LogWarning(object message) { }
        public static void LogWarning(object message, Object context) { }
    }
    public static class JsonUtility { public static T FromJson<T>(string json) { return default(T); } }
    public class TextAsset : Object { public string text { get { return ""; } } }
    public class Texture : Object { public int mipmapCount { get { return 1; } } }
    public sealed class Texture2D : Texture { }
    public sealed class Cubemap : Texture { public Color[] GetPixels(CubemapFace face, int miplevel) { return null; } }
    public enum CubemapFace { Unknown = -1, PositiveX, NegativeX, PositiveY, NegativeY, PositiveZ, NegativeZ }
    public sealed class Shader : Object { public static Shader Find(string name) { return null; } }
    public class Material : Object
    {
        public Material(Shader shader) { }
        public void SetTexture(string name, Texture value) { }
        public void SetFloat(string name, float value) { }
        public void SetColor(string name, Color value) { }
        public void EnableKeyword(string keyword) { }
    }
    public sealed class Mesh : Object
    {
        public Rendering.IndexFormat indexFormat { get; set; }
        public Vector3[] vertices { get; set; }
        public Vector3[] normals { get; set; }
        public Vector2[] uv { get; set; }
        public int[] triangles { get; set; }
        public int vertexCount { get { return 0; } }
        public void RecalculateBounds() { }
    }
    public sealed class MeshFilter : Component { public Mesh sharedMesh { get; set; } }
    public class Renderer : Component
    {
        public Material sharedMaterial { get; set; }
        public Rendering.ShadowCastingMode shadowCastingMode { get; set; }
        public bool receiveShadows { get; set; }
    }
    public class MeshRenderer : Renderer { }
    public class Collider : Component { }
    public sealed class Camera : Behaviour
    {
        public bool usePhysicalProperties { get; set; }
        public float fieldOfView { get; set; }
        public float nearClipPlane { get; set; }
        public float farClipPlane { get; set; }
    }
    public enum LightType { Spot, Directional, Point }
    public enum LightShadows { None, Hard, Soft }
    public sealed class Light : Behaviour
    {
        public LightType type { get; set; }
        public Color color { get; set; }
        public float intensity { get; set; }
        public bool useColorTemperature { get; set; }
        public LightShadows shadows { get; set; }
        public Rendering.LightUnit lightUnit { get; set; }
    }
    public static class RenderSettings
    {
        public static Material skybox { get; set; }
        public static Rendering.AmbientMode ambientMode { get; set; }
        public static float ambientIntensity { get; set; }
        public static float reflectionIntensity { get; set; }
        public static Rendering.DefaultReflectionMode defaultReflectionMode { get; set; }
    }
    public static class DynamicGI { public static void UpdateEnvironment() { } }
    public enum ColorSpace { Uninitialized = -1, Gamma, Linear }
}

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
    public enum ShadowCastingMode { Off, On, TwoSided, ShadowsOnly }
    public enum AmbientMode { Skybox, Trilight, Flat = 3, Custom }
    public enum DefaultReflectionMode { Skybox, Custom }
    public enum LightUnit { Lumen, Candela, Lux, Nits, Ev100 }
    public class VolumeParameter<T> { public void Override(T x) { } }
    public class VolumeComponent : ScriptableObject { }
    public sealed class VolumeProfile : ScriptableObject
    {
        public List<VolumeComponent> components;
        public T Add<T>(bool overrides) where T : VolumeComponent { return null; }
    }
    public sealed class Volume : MonoBehaviour
    {
        public bool isGlobal { get; set; }
        public VolumeProfile sharedProfile;
    }
}

namespace UnityEngine.Rendering.HighDefinition
{
    public enum SkyType { HDRI = 1, PhysicallyBased = 4 }
    public enum SkyAmbientMode { Static, Dynamic }
    public enum SkyIntensityMode { Exposure, Lux, Multiplier }
    public enum ExposureMode { Fixed, Automatic, AutomaticHistogram = 4 }
    public enum TonemappingMode { None, Neutral, ACES, Custom, External }
    public class VisualEnvironment : VolumeComponent
    {
        public VolumeParameter<int> skyType;
        public VolumeParameter<SkyAmbientMode> skyAmbientMode;
    }
    public class HDRISky : VolumeComponent
    {
        public VolumeParameter<Cubemap> hdriSky;
        public VolumeParameter<float> rotation, multiplier;
        public VolumeParameter<SkyIntensityMode> skyIntensityMode;
    }
    public class Exposure : VolumeComponent
    {
        public VolumeParameter<ExposureMode> mode;
        public VolumeParameter<float> fixedExposure;
    }
    public class Tonemapping : VolumeComponent { public VolumeParameter<TonemappingMode> mode; }
    public class HDAdditionalCameraData : MonoBehaviour { }
    public class HDAdditionalLightData : MonoBehaviour
    {
        public float angularDiameter { get; set; }
        public void EnableShadows(bool enabled) { }
        public static void InitDefaultHDAdditionalLightData(HDAdditionalLightData lightData) { }
    }
    public static class HDMaterial { public static bool ValidateMaterial(Material material) { return true; } }
}

namespace UnityEditor
{
    [AttributeUsage(AttributeTargets.Method)]
    public sealed class MenuItem : Attribute { public MenuItem(string itemName) { } }
    public static class PlayerSettings { public static UnityEngine.ColorSpace colorSpace { get; set; } }
    public static class Undo
    {
        public static void DestroyObjectImmediate(UnityEngine.Object objectToUndo) { }
        public static void RegisterCreatedObjectUndo(UnityEngine.Object objectToUndo, string name) { }
    }
    public static class Selection { public static UnityEngine.Object activeObject { get { return null; } } }
    public static class AssetDatabase
    {
        public static string[] GetSubFolders(string path) { return null; }
        public static string GetAssetPath(UnityEngine.Object assetObject) { return ""; }
        public static T LoadAssetAtPath<T>(string assetPath) where T : UnityEngine.Object { return null; }
        public static bool DeleteAsset(string path) { return true; }
        public static void CreateAsset(UnityEngine.Object asset, string path) { }
        public static void AddObjectToAsset(UnityEngine.Object objectToAdd, UnityEngine.Object assetObject) { }
        public static void SaveAssets() { }
    }
    public static class EditorUtility { public static void SetDirty(UnityEngine.Object target) { } }
}
